//! Everything that a control period reads and does not change.

use fixed::types::I1F31;
use fixed::types::extra::{U16, U27, U28, U31, U32};

use crate::control::observer::back_emf;
use crate::control::regulator::observer_based as regulator;
use crate::control::{modulator, speed, start};
use crate::math::Gain;
use crate::protection;
use crate::units::{Scale, Speed};

/// Direction of rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Phases in the order a, b, c.
    Normal,
    /// Phases in the order a, c, b.
    Reversed,
}

/// How the motor is stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// Without torque, then the bridge off.
    Coast,
    /// By regenerative braking, then all low sides on.
    Brake,
}

/// What the compensation of the dead time must know.
#[derive(Clone, Debug, PartialEq)]
pub struct DeadTime {
    /// Phase current to duty: the whole compensation at 0.3 A, where the current has a sign.
    pub slope: Gain<U27, U31>,
    /// The whole compensation: dead time over period.
    pub duty: I1F31,
}

/// The drive's configuration, computed by [`crate::params::build`] and swapped in whole.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// What the control's units are worth.
    pub scale: Scale,
    /// Counts of the supply's converter to voltage.
    pub bus: Gain<U16, U28>,
    /// Direction of rotation.
    pub direction: Direction,
    /// How the motor is stopped.
    pub stop: Stop,
    /// Back-EMF observer.
    pub observer: back_emf::Config,
    /// Current regulator.
    pub regulator: regulator::Config,
    /// Speed regulator.
    pub speed: speed::Config,
    /// Greatest change of the speed reference in a period.
    pub slew: Speed,
    /// Start-up.
    pub start: start::Config,
    /// Speed below which the observer no longer leads.
    pub slow: Speed,
    /// Share of the reported speed that a period with the bridge off takes away.
    pub coast: Gain<U32, U32>,
    /// Modulator.
    pub modulator: modulator::Config,
    /// Compensation of the dead time.
    pub dead_time: DeadTime,
    /// Limits.
    pub protection: protection::Config,
    /// Periods at zero throttle after which a fault whose cause is gone has ended.
    pub clear_periods: u32,
    /// Periods in a row for which ξ̂ may stand at the end of its range.
    pub lost_periods: u32,
}
