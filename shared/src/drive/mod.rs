//! One control period: [`step()`] takes a sample and a set-point, and returns what the bridge does.
//!
//! # A period, from top to bottom
//! `step.rs` first decides the mode (by the set-point in `mode_change.rs`, by the rotor in each mode's own file)
//! and does this period's slice of the outer loop (`schedule.rs`, 32 periods), both from what the last period saw.
//! Then it reads and checks the sample (`shared.rs`, [`protection`](crate::protection)), and the mode does its own
//! work: it determines what the bridge does, and possibly why the mode ends. The default observer and regulator
//! have dedicated code, all others share one path (`foc/period.rs`).
//!
//! A set-point of another kind takes effect in its own period, and so does a fault; in Idle, while observing a
//! turning rotor, in the next. One of the same kind that only changes sign takes effect within one schedule cycle,
//! at most 32 periods later.
//!
//! # From the sample to the duties
//! In Run, with the files that do it:
//!
//! | step | file |
//! |---|---|
//! | the ADC counts become a [`Sample`] | `firmware/src/interrupt/sample.rs`; emulator: `plant/sensing.rs` |
//! | offsets are subtracted; a phase that could not be read is reconstructed from the other two | `shared.rs`, [`control::sensing`](crate::control::sensing) |
//! | a current or voltage beyond its trip ends the drive | `step.rs`, [`protection`](crate::protection) |
//! | Clarke, then the observer's angle and speed, then Park | `foc/period.rs`, `foc/current_loop.rs`, [`control::observer`](crate::control::observer) |
//! | the current regulator's voltage, with decoupling; anti-windup where the supply falls short | `foc/current_loop.rs`, [`control::regulator`](crate::control::regulator) |
//! | delay compensation, inverse Park, dead time, duties | [`Delay`](siskin_params::Delay), [`control::modulator`](crate::control::modulator) |
//! | the duties reach the timer, effective from the next period | `firmware/src/interrupt/pwm.rs`; emulator: `plant/inverter.rs` |
//!
//! The regulator's reference comes from the outer loop: speed regulator, limits, delay compensation and dead-time
//! sign are parts of `foc/outer_loop.rs`.
//!
//! # What ends a drive
//!
//! | reason | decided in |
//! |---|---|
//! | the set-point asks for rest, or for the other direction | `mode_change.rs`; six-step: `six_step/outer.rs` |
//! | the set-point is a fault, found outside the drive or by the hardware | `step.rs` |
//! | a sample beyond a trip | `step.rs`, by [`protection::check`](crate::protection::check) |
//! | a stop has come to rest; a start has failed; the rotor is lost, or stuck | `foc/open_loop.rs`; six-step: `six_step/start.rs`, `six_step/period.rs` |
//! | a current sensor's zero is off | `off.rs` |
//!
//! A defective sensor or phase of a turning motor is reported and ends no drive: `current_monitor.rs`. `drift.rs` follows
//! its resistance and flux.
//!
//! Throttle that is lost, closed or not armed reaches this point as a set-point of rest:
//! [`Throttle::setpoint`](crate::throttle::Throttle::setpoint) sees to that.
//!
//! # The modes
//! The modes are the values of [`Phase`].
//!
//! | mode | file | what it does and remembers |
//! |---|---|---|
//! | Idle, Sense | `off.rs` | the bridge is off: watches the rotor, measures the current offsets |
//! | Charge | `charge.rs` | charges the drivers' supplies, then prepares the drive (`foc/begin.rs`) |
//! | Park, Ramp | `foc/open_loop.rs` | imposes the frame, the rotor follows |
//! | Run, Stopping | `foc/` | field-oriented control |
//! | Brake | `foc/brake.rs` | the low sides are on, the observer keeps running |
//! | Ramp, Run, Stopping, Brake with `CTL_DRIVE` 1 | `six_step/` | the same by zero crossings; Ramp seeks the rotor |
//! | Tone | `tone.rs`, `self_test.rs`, `excite.rs` | the phases switch to be heard, tested or measured: [`Setpoint::Pull`], [`Setpoint::Excite`] |
//!
//! `transitions.rs` has the table of all mode changes with their reasons. One function makes them, `State::change`,
//! except for a restart under other units ([`State::adopt`]):
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
//!  Idle -- Shorted --> Brake
//!
//!  Charge -- Seeks --> Ramp: the six-step drive, which has no Park
//!
//!  Charge, Stopping, Brake -- Followed --> Park: a rotor that turns slowly, or slowed down the other way
//! ```
//!
//! # File order
//! Each file uses only those before it: `phase`, `pull`, `excitation`, `io`, `config`, `transitions`,
//! `schedule`, `seen`, `shared`, `off`, `charge`, `tone`, `self_test`, `excite`, `foc`, `six_step`, `snapshot`, `limited`,
//! `current_monitor`, `drift`, `state`, `mode_change`, `step`.

mod charge;
pub mod config;
mod current_monitor;
mod drift;
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

pub use crate::protection::{Fault, Faults, Limit, Limits};
pub use config::{ATTEMPTS, Charge, Config, Direction, Stop, put_default};
pub use current_monitor::CurrentMonitor;
pub use drift::{Drift, Stated, Tracker};
pub use excitation::{Excitation, Ripple};
pub use io::{Bridge, Sample, Setpoint};
pub use limited::Thresholds;
pub use phase::Phase;
pub use pull::Pull;
pub use snapshot::Snapshot;
pub use state::{LastFault, State};
pub use step::step;

#[cfg(test)]
mod tests;
