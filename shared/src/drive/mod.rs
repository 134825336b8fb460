//! One control period: [`step()`] takes a sample and a set-point, and says what the bridge does.
//!
//! # A period, from top to bottom
//! `step.rs`: the mode is decided (`asked.rs`, and of what the rotor does each mode's own file), the sample is
//! read and judged (`shared.rs`, [`protection`](crate::protection)), the mode does its own work, and says what
//! the bridge does and perhaps why it ends. The outer loop's work is sliced over 32 periods (`schedule.rs`).
//! Observer and regulator are chosen in one place (`foc/period.rs`).
//!
//! # The modes
//! | mode | file | what it does and remembers |
//! |---|---|---|
//! | Idle, Sense | `off.rs` | the bridge is off: the rotor is watched, the currents' zeros are measured |
//! | Charge | `charge.rs` | the drivers' supplies are charged, then the drive is made ready (`foc/begin.rs`) |
//! | Park, Ramp | `foc/open_loop.rs` | the frame is imposed, the rotor follows |
//! | Run, Stopping | `foc/` | field-oriented control |
//! | Brake | `foc/short.rs` | the low sides are on, the observer goes on |
//! | Park to Brake | `six_step/` | the same by zero crossings, where the six-step drive is configured |
//! | Tone | `tone.rs`, `self_test.rs` | the phases switch to be heard, or to be tested |
//!
//! All changes of mode, each with its reason, are the table in `transitions.rs`; they are made by one
//! function, `State::change`:
//!
//! ```text
//!        Drive, Sound           Sensed            Stands            Aligned
//!  Idle --------------> Sense ----------> Charge ----------> Park ----------> Ramp
//!   ^ ^                   |                | | |               |   Released     |
//!   | |     Released,     |                | | |               +----------------+--> Idle or
//!   | +-------------------+----------------+ | |                                |    Brake
//!   |       TooFast                          | | Caught                         |
//!   |                                 Sounds | +---------------> Run <----------+ HandedOver
//!   | Released    Shorted                    v                  |   ^
//!   +---------- Tone ------> Brake          Tone       Released |   | Resumed
//!   ^             | Drive     |  |                              v   |
//!   |             v           |  +--- Resumed ---> Run       Stopping <--- CaughtBackwards (Charge)
//!   |           Sense <-------+ Drive, Sound                    |
//!   |                                                           | Stopped
//!   |                                                           +--> Idle or Brake
//!   +--- Coasts (Run, Stopping), Failed (Ramp, Run, Stopping), Tripped (any)
//! ```
//!
//! # The files' order
//! Each file uses those before it, and none behind it: `phase`, `pull`, `io`, `config`, `transitions`,
//! `schedule`, `seen`, `shared`, `off`, `charge`, `tone`, `self_test`, `foc`, `six_step`, `snapshot`, `state`,
//! `asked`, `step`.

mod asked;
mod charge;
pub mod config;
mod foc;
mod io;
mod off;
mod phase;
mod pull;
mod schedule;
mod seen;
mod self_test;
mod shared;
mod six_step;
mod snapshot;
mod state;
mod step;
mod tone;
mod transitions;

pub use crate::protection::{Fault, Faults};
pub use config::{ATTEMPTS, Charge, Config, Direction, Stop};
pub use io::{Bridge, Sample, Setpoint};
pub use phase::Phase;
pub use pull::Pull;
pub use snapshot::Snapshot;
pub use state::State;
pub use step::step;

#[cfg(test)]
mod tests;
