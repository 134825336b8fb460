//! Everything that a control period reads and does not change.

pub mod six_step;
pub mod tone;

use core::mem::MaybeUninit;

use crate::control::delay::Delay;
use crate::control::{
    catch, dead_time, inductance, low_speed, modulator, observer, regulator, sensing, speed, start,
    torque,
};
use crate::math::{Gain, Multiplier};
use crate::protection;
use crate::units::{AdcCounts, Current, Duty, Scale, Speed, Voltage, WideVoltage};

/// Direction of rotation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Direction {
    /// Phases in the order a, b, c.
    #[default]
    Normal,
    /// Phases in the order a, c, b.
    Reversed,
}

/// Way to stop the motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stop {
    /// The bridge off: at once by field-oriented control, by the six-step drive when the shaft is slow. On the way to
    /// the other direction the shaft is braked all the same.
    #[default]
    Coast,
    /// By regenerative braking, then all low sides on.
    Brake,
}

/// Charging of the supplies of the high sides' drivers before the phases switch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Charge {
    /// The low sides' share of each period.
    pub duty: Duty,
    /// Periods that it takes.
    pub periods: u32,
    /// Of these, how many are left out where the rotor turns, which it does unseen meanwhile.
    pub spared_periods: u32,
}

/// Attempts of a start.
pub const ATTEMPTS: usize = 4;

/// The drive's configuration, computed by [`crate::params::build`] and swapped in whole.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// The control's units in SI.
    pub scale: Scale,
    /// Counts of the supply's converter to voltage.
    pub bus: Multiplier<AdcCounts, WideVoltage>,
    /// Direction of rotation.
    pub direction: Direction,
    /// Way to stop the motor.
    pub stop: Stop,
    /// True if a set-point may turn the motor the other way.
    pub both_ways: bool,
    /// Voltage commanded to voltage applied.
    pub delay: Delay,
    /// Position observer.
    pub observer: observer::Config,
    /// Current regulator.
    pub regulator: regulator::Config,
    /// Planner and speed regulator.
    pub speed: speed::Config,
    /// Torque and voltage mode.
    pub torque: torque::Config,
    /// Adaptation of the inductance, if it is asked for.
    pub adapt_l: Option<inductance::Config>,
    /// Currents and bounds for the observer at low speed.
    pub low_speed: low_speed::Config,
    /// The attempts of a start, in order.
    pub start: [start::Config; ATTEMPTS],
    /// Greatest current of a test of the motor.
    pub test_current: Current,
    /// Speed below which the observer no longer leads.
    pub slow: Speed,
    /// Share of the reported speed that a period with the bridge off takes away.
    pub coast: Gain<Speed, Speed>,
    /// Modulator.
    pub modulator: modulator::Config,
    /// Current sensors.
    pub sensing: sensing::Config,
    /// Rotor that turns while the bridge is off.
    pub catch: catch::Config,
    /// Charging before a switch-on.
    pub charge: Charge,
    /// Compensation of the dead time.
    pub dead_time: dead_time::Config,
    /// Limits.
    pub protection: protection::Config,
    /// Tones, if any are to be heard.
    pub tone: Option<tone::Config>,
    /// The six-step drive, where it is to drive the motor.
    pub six_step: Option<six_step::Config>,
    /// Periods for which Run may be slow before it ends.
    pub slow_periods: u32,
    /// Periods for which Run must have lasted before a start counts as done.
    pub proven_periods: u32,
    /// Periods at zero throttle after which a fault whose cause is gone has ended.
    pub clear_periods: u32,
    /// Periods without its cause after which a fault ends for the first retry of a drive that has proven itself; 0 if
    /// there is none.
    pub retry_periods: u32,
    /// Periods in a row for which the observer's state may be out of its range.
    pub lost_periods: u32,
    /// Least voltage along q in voltage mode: the back-EMF of the least speed that the observer can know.
    pub least_u_q: Voltage,
}

/// Makes a default in its place. Never inlined: so it is not copied there from a stack, and the chip has a
/// configuration's code once.
#[inline(never)]
pub fn put_default<T: Default>(place: &mut MaybeUninit<T>) -> &mut T {
    place.write(T::default())
}

impl Config {
    /// This drive, told where its rotor is by [`State::place`](crate::drive::State::place) in place of
    /// an observer. It starts from standstill without aligning the rotor.
    pub fn with_position_given(self) -> Self {
        Self {
            observer: observer::Config::Given,
            // 0.9 s, as for a motor with sensors: it begins Run at standstill.
            slow_periods: self.proven_periods.saturating_mul(3),
            ..self
        }
    }
}
