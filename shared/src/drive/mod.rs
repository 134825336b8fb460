//! One control period: [`step()`] takes a sample and a set-point, and says what the bridge does.

mod config;
mod launch;
mod phase;
mod pull;
mod rest;
pub mod six_step;
mod slow;
mod state;
mod step;
pub mod tone;
mod turn;

pub use crate::protection::{Fault, Faults};
pub use config::{ATTEMPTS, Charge, Config, Direction, Stop};
pub use phase::Phase;
pub use pull::Pull;
pub use state::{Snapshot, State};
pub use step::step;

use fixed::types::I1F31;

use crate::units::{AdcCounts, Current, Duty, Speed};

/// What the converter read for one control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Phase currents a, b, c into the motor, as the converter reads them: with the sensors' offsets
    /// about a nominal zero, at the middle of the low sides' on-time.
    pub currents: [AdcCounts; 3],
    /// The supply's voltage.
    pub bus: AdcCounts,
    /// Voltages of the motor's terminals a, b, c against the supply's negative pole.
    pub terminals: [AdcCounts; 3],
    /// Hall sensors a, b, c in bits 0, 1, 2: high while the rotor's flux through the phase is
    /// positive. Without sensors their pull-ups read 7.
    pub hall: u8,
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
    /// Turn at this electrical speed; negative ones, here and below, are the other way.
    Speed(Speed),
    /// Hold this current i_q.
    Torque(Current),
    /// Apply this share of the voltage that the supply can give.
    Voltage(I1F31),
    /// Play a tone of this pitch, in cycles a period, without turning the motor: of at most
    /// [`tone::PITCH_MAX`]; zero is a pause between two notes.
    Tone(Speed),
    /// Hold this current i_q for a test; the start uses no more than a test may either.
    Test(Current),
    /// Pull half-bridges to the supply's poles without turning the motor, once it is seen to stand.
    Pull(Pull),
}

/// What the inverter does until the next period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bridge {
    /// All switches off.
    Off,
    /// The low sides on for this share of the period around the sample and all else off: it charges
    /// the supplies of the high sides' drivers.
    Charge(Duty),
    /// All low sides on.
    Brake,
    /// Each phase switches; the share of the period for which its high side is on.
    Duty([Duty; 3]),
    /// As `Duty`, but a phase with `None` has both switches off.
    Legs([Option<Duty>; 3]),
}

#[cfg(test)]
mod tests;
