//! One control period: [`step()`] takes a sample and a set-point, and says what the bridge does.
//!
//! # A period, from top to bottom
//! `step.rs`: the mode is decided (`mode_change.rs`, and by what the rotor does in each mode's own file) and this
//! period's slice of the outer loop's work is done (`schedule.rs`, 32 periods), both from what the last period
//! saw. Then the sample is read and judged (`shared.rs`, [`protection`](crate::protection)), and the mode does
//! its own work: it says what the bridge does, and perhaps why it ends. The default observer and regulator have
//! a piece of code of their own, any others share one (`foc/period.rs`).
//!
//! A set-point of another kind is obeyed in its own period, and so is a fault; in Idle, while a turning rotor is
//! looked at, in the next. One of the same kind that only
//! changes its sign is obeyed within a cycle of the schedule, at most 32 periods later.
//!
//! # From the sample to the duties
//! In Run, with the files in which to read it:
//!
//! | step | file |
//! |---|---|
//! | the converters' counts become a [`Sample`] | `firmware/src/interrupt/sample.rs`; emulator: `plant/sensing.rs` |
//! | less their zeros, and a phase that could not be read from the other two | `shared.rs`, [`control::sensing`](crate::control::sensing) |
//! | a current or a voltage beyond its trip ends the drive | `step.rs`, [`protection`](crate::protection) |
//! | Clarke, then the observer's angle and speed, then Park | `foc/period.rs`, `foc/current_loop.rs`, [`control::observer`](crate::control::observer) |
//! | the current regulator's voltage, with its decoupling; anti-windup where the supply gives less | `foc/current_loop.rs`, [`control::regulator`](crate::control::regulator) |
//! | turned ahead by the delay, inverse Park, dead time, duties | [`control::delay`](crate::control::delay), [`control::modulator`](crate::control::modulator) |
//! | the duties reach the timer, in force from the next period on | `firmware/src/interrupt/pwm.rs`; emulator: `plant/inverter.rs` |
//!
//! The regulator's reference is the outer loop's: speed regulator, limits, delay compensation and dead-time sign
//! are pieces of `foc/outer_loop.rs`.
//!
//! # What ends a drive
//!
//! | reason | decided in |
//! |---|---|
//! | the set-point asks for rest, or for the other rotation | `mode_change.rs`; six-step: `six_step/period.rs` |
//! | the set-point is a fault: found outside the drive, or by the hardware | `step.rs` |
//! | a sample beyond a trip | `step.rs`, by [`protection::check`](crate::protection::check) |
//! | a stop has come to rest; a start has failed; the rotor is lost, or stuck | `foc/open_loop.rs`; six-step: `six_step/start.rs`, `six_step/period.rs` |
//! | a current sensor's zero is off | `off.rs` |
//!
//! What is wrong with a sensor or a phase of a motor that turns is told, and ends no drive: `witness.rs`.
//!
//! Throttle that is lost, closed or not armed is a set-point of rest by the time that it comes here:
//! [`Throttle::setpoint`](crate::throttle::Throttle::setpoint) makes it so.
//!
//! # The modes
//! They are the values of [`Phase`].
//!
//! | mode | file | what it does and remembers |
//! |---|---|---|
//! | Idle, Sense | `off.rs` | the bridge is off: the rotor is watched, the currents' zeros are measured |
//! | Charge | `charge.rs` | the drivers' supplies are charged, then the drive is made ready (`foc/begin.rs`) |
//! | Park, Ramp | `foc/open_loop.rs` | the frame is imposed, the rotor follows |
//! | Run, Stopping | `foc/` | field-oriented control |
//! | Brake | `foc/brake.rs` | the low sides are on, the observer goes on |
//! | Park, Ramp, Run, Stopping, Brake with `CTL_DRIVE` 1 | `six_step/` | the same by zero crossings |
//! | Tone | `tone.rs`, `self_test.rs`, `excite.rs` | the phases switch to be heard, or to be tested or measured: [`Setpoint::Pull`], [`Setpoint::Excite`] |
//!
//! All changes of mode, each with its reason, are the table in `transitions.rs`; they are made by one
//! function, `State::change`, but for a restart under other units ([`State::adopt`]):
//!
//! ```text
//!        Drive, Tone            Sensed            Stands            Aligned
//!  Idle --------------> Sense ----------> Charge ----------> Park ----------> Ramp
//!   ^ ^                   |                | | |               |   Released     |
//!   | |     Released,     |                | | |               +----------------+--> Idle or
//!   | +-------------------+----------------+ | |                                |    Brake
//!   |       TooFast                          | | Caught                         |
//!   |                              ToneReady | +---------------> Run <----------+ HandedOver
//!   | Released    Shorted                    v                  |   ^
//!   +---------- Tone ------> Brake          Tone       Released |   | Resumed
//!   ^             | Drive     |  |                              v   |
//!   |             v           |  +--- Resumed ---> Run       Stopping <--- CaughtBackwards (Charge)
//!   |           Sense <-------+ Drive, Tone                     |
//!   |                                                           | Stopped
//!   |                                                           +--> Idle or Brake
//!   +--- Coasts (Run, Stopping), Failed (Ramp, Run, Stopping), Tripped (any)
//!
//!  Ramp, Run, Stopping -- Retried, by the six-step drive --> Park        Idle -- Shorted --> Brake
//! ```
//!
//! # The files' order
//! Each file uses those before it, and none behind it: `phase`, `pull`, `excitation`, `io`, `config`, `transitions`,
//! `schedule`, `seen`, `shared`, `off`, `charge`, `tone`, `self_test`, `excite`, `foc`, `six_step`, `snapshot`, `limited`,
//! `witness`, `state`, `mode_change`, `step`.

mod charge;
pub mod config;
mod excitation;
mod excite;
mod foc;
mod io;
mod limited;
mod mode_change;
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
mod witness;

pub use crate::protection::{Fault, Faults, Limit, Limits};
pub use config::{ATTEMPTS, Charge, Config, Direction, Stop, put_default};
pub use excitation::{Excitation, Ripple};
pub use io::{Bridge, Sample, Setpoint};
pub use limited::Thresholds;
pub use phase::Phase;
pub use pull::Pull;
pub use snapshot::Snapshot;
pub use state::{LastFault, State};
pub use step::step;
pub use witness::Witness;

#[cfg(test)]
mod tests;
