//! The interrupt at the end of the injected conversions, once per PWM period: sample, `step`, bridge.
//!
//! It alone has priority 0. It uses no critical section, no logging and no driver.

#[cfg(board)]
mod gate_driver;
#[cfg(board)]
mod leg;
#[cfg_attr(
    not(any(board, test)),
    expect(dead_code, reason = "for the boards; tested on the host")
)]
mod overruns;
#[cfg(board)]
mod period;
#[cfg_attr(
    not(any(board, test)),
    expect(dead_code, reason = "for the boards; tested on the host")
)]
mod publication;
#[cfg(board)]
mod pwm;
#[cfg(board)]
mod registers;
#[cfg_attr(
    not(any(board, test)),
    expect(dead_code, reason = "for the boards; tested on the host")
)]
mod rest;
#[cfg(board)]
pub(crate) mod sample;
#[cfg(board)]
mod start;
#[cfg_attr(
    not(any(board, test)),
    expect(dead_code, reason = "for the boards; tested on the host")
)]
mod timing;

#[cfg(board)]
pub use period::{Interrupt, periods, record};
#[cfg(board)]
pub use registers::{Registers, Stand};
#[cfg(board)]
pub use start::{set_trip, start};
