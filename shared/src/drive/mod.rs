//! One control period: [`step`] takes a sample and a set-point, and says what the bridge does.

mod config;
mod state;
mod step;

pub use crate::protection::{Fault, Faults};
pub use config::{Config, DeadTime, Direction, Stop};
pub use state::{Phase, Snapshot, State, TRACE_WORDS};
pub use step::step;

use crate::units::{AdcCounts, Current, Duty, Speed};

/// What the converter read for one control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Phase currents a, b, c into the motor, without the sensors' offsets.
    pub currents: [AdcCounts; 3],
    /// The supply's voltage.
    pub bus: AdcCounts,
}

/// What the motor is asked to do; it comes from something that may turn it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setpoint {
    /// No drive: coast or brake, as configured.
    Stop,
    /// The same, because the throttle is at zero: that also ends a latched fault.
    Zero,
    /// No drive, the bridge off, for a reason that something outside the interrupt has found.
    Fault(Fault),
    /// Turn at this electrical speed.
    Speed(Speed),
    /// Hold this current i_q.
    Torque(Current),
    /// Hold this current i_q for a test; the start uses no more than a test may either.
    Test(Current),
}

/// What the inverter does until the next period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bridge {
    /// All switches off.
    Off,
    /// All low sides on.
    Brake,
    /// Each phase switches; the share of the period for which its high side is on.
    Duty([Duty; 3]),
}

#[cfg(test)]
mod tests;
