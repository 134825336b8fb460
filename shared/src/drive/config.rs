//! Everything that a control period reads but does not change.

pub mod six_step;
pub mod tone;

use core::mem::MaybeUninit;

use siskin_params::{Delay, parts};
use siskin_units::math::{Gain, Multiplier};
use siskin_units::{AdcCounts, Current, Duty, Scale, Speed, Voltage, WideVoltage};

use crate::control::{
    catch, dead_time, inductance, low_speed, modulator, observer, regulator, sensing, speed, start,
    torque, weakening,
};
use crate::protection;

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
    /// The bridge turns off: at once in field-oriented control, once the shaft is slow in six-step. To reverse, the
    /// shaft is braked all the same.
    #[default]
    Coast,
    /// Regenerative braking, then all low sides on.
    Brake,
}

/// Charging of the high-side drivers' supplies before the phases switch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Charge {
    /// The low sides' share of each period.
    pub duty: Duty,
    /// Number of periods.
    pub periods: u32,
    /// Periods skipped if the rotor turns, since it goes unobserved meanwhile.
    pub spared_periods: u32,
}

/// Attempts of a start.
pub const ATTEMPTS: usize = 4;

/// Quick attempts ahead of them, for a motor that has turned in this flight: it is probably held, and should turn again
/// soon after it is let go.
pub const QUICK_ATTEMPTS: u8 = 32;

/// The drive's configuration, computed by [`crate::build::build`] and swapped in whole.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// The control's units in SI.
    pub scale: Scale,
    /// From the supply's ADC counts to voltage.
    pub bus: Multiplier<AdcCounts, WideVoltage>,
    /// Direction of rotation.
    pub direction: Direction,
    /// Way to stop the motor.
    pub stop: Stop,
    /// A set-point may turn the motor the other way.
    pub both_ways: bool,
    /// Delay from the commanded voltage to the applied one.
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
    /// Flux weakening.
    pub weakening: weakening::Config,
    /// The quick attempt, and those of a start in order.
    pub start: [start::Config; 1 + ATTEMPTS],
    /// Supply whose longest vector an open-loop start may use: enough to take a sound motor's current to its limit at
    /// the speed where the start ends. Where a phase does not conduct, the regulator asks for ever more, which would drive the
    /// other phases far beyond the limit as the frame turns on.
    pub start_bus: Voltage,
    /// Greatest current of a test of the motor.
    pub test_current: Current,
    /// Speed below which the observer no longer leads.
    pub slow: Speed,
    /// Share of the reported speed that each bridge-off period takes away.
    pub coast: Gain<Speed, Speed>,
    /// Modulator.
    pub modulator: modulator::Config,
    /// Current sensors.
    pub sensing: sensing::Config,
    /// Observation of a turning rotor while the bridge is off.
    pub catch: catch::Config,
    /// Charging before a switch-on.
    pub charge: Charge,
    /// Compensation of the dead time.
    pub dead_time: dead_time::Config,
    /// Limits.
    pub protection: protection::Config,
    /// Tones, if any are to be heard.
    pub tone: Option<tone::Config>,
    /// The six-step drive, if it drives the motor.
    pub six_step: Option<six_step::Config>,
    /// Periods for which Run may be slow before it ends.
    pub slow_periods: u32,
    /// Periods of Run after which a start counts as done.
    pub proven_periods: u32,
    /// Periods of zero throttle after which a fault whose cause is gone ends.
    pub clear_periods: u32,
    /// Periods without its cause after which a fault ends for the first retry of a proven drive; 0 disables
    /// retries.
    pub retry_periods: u32,
    /// Consecutive periods for which the observer's state may be out of range.
    pub lost_periods: u32,
    /// Smallest q voltage in voltage mode: the back-EMF of the lowest speed the observer can track.
    pub least_u_q: Voltage,
}

/// Writes a default in place. Never inlined, which avoids a copy from the stack and keeps a single copy of a
/// configuration's code on the chip.
#[inline(never)]
pub fn put_default<T: Default>(place: &mut MaybeUninit<T>) -> &mut T {
    place.write(T::default())
}

impl Config {
    /// Returns this drive with the rotor's position given by [`State::place`](crate::drive::State::place) instead
    /// of an observer. It starts from standstill without aligning the rotor.
    pub fn with_position_given(self, part: parts::Bench) -> Self {
        Self {
            observer: observer::Config::Given(part),
            // 0.9 s, as for a motor with sensors: it begins Run at standstill.
            slow_periods: self.proven_periods.saturating_mul(3),
            ..self
        }
    }
}
