//! The interrupt at the end of the injected conversions, once a PWM period: sample, `step`, bridge.
//!
//! It alone has priority 0. It takes no critical section, does not log and calls no driver.

#[cfg_attr(
    not(any(board, test)),
    expect(dead_code, reason = "for the boards; tested on the host")
)]
mod overruns;
#[cfg_attr(
    not(any(board, test)),
    expect(dead_code, reason = "for the boards; tested on the host")
)]
mod rest;
#[cfg_attr(
    not(any(board, test)),
    expect(dead_code, reason = "for the boards; tested on the host")
)]
pub(crate) mod timing;
#[cfg_attr(
    not(any(feature = "stm32g431", test)),
    expect(
        dead_code,
        reason = "for the boards with comparators; tested on the host"
    )
)]
pub(crate) mod trip_level;

#[cfg(board)]
pub(crate) mod gate_driver;
#[cfg(board)]
mod period;
#[cfg(board)]
pub(crate) mod pwm;
#[cfg(board)]
mod registers;
#[cfg(board)]
pub(crate) mod sample;
#[cfg(board)]
mod start;

#[cfg(all(board, feature = "vesc4-f405"))]
pub(crate) use gate_driver::alarm;
#[cfg(board)]
pub use period::{Interrupt, overruns, periods};
#[cfg(board)]
pub use registers::{Registers, Stand};
#[cfg(board)]
pub use start::{set_trip, start};
