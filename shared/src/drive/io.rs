//! Inputs and output of a control period: sample, set-point, bridge.

use fixed::types::I1F31;
use siskin_units::{AdcCounts, Current, Duty, Speed};

use super::excitation::Excitation;
use super::pull::Pull;
use crate::protection::Fault;

/// The ADC readings of one control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Currents into the motor of phases a, b, c, as read: with the sensors' offsets around a nominal zero, sampled
    /// mid low-side on-time.
    pub currents: [AdcCounts; 3],
    /// Supply voltage.
    pub bus: AdcCounts,
    /// Voltages of motor terminals a, b, c against the supply's negative pole.
    pub terminals: [AdcCounts; 3],
    /// Hall sensors a, b, c in bits 0, 1, 2: high while the rotor's flux through the phase is positive. Without
    /// sensors the pull-ups read 7.
    pub hall: u8,
}

/// The demand on the motor, from a source that may turn it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setpoint {
    /// No drive: coast or brake, as configured.
    Stop,
    /// No drive because the throttle is at zero, which also clears a latched fault.
    Zero,
    /// No drive, bridge off, for a reason found outside the interrupt.
    Fault(Fault),
    /// Turn at this electrical speed; negative, here and below, is the other direction.
    Speed(Speed),
    /// Hold this current i_q.
    Torque(Current),
    /// Apply this share of the available voltage.
    Voltage(I1F31),
    /// Play a tone of this pitch, in cycles per period, without turning the motor. At most
    /// [`PITCH_MAX`](super::config::tone::PITCH_MAX); zero is a pause between two notes.
    Tone(Speed),
    /// Hold this current i_q for a test; the start, too, uses at most a test's current.
    Test(Current),
    /// Pull half-bridges to the supply rails without turning the motor, once it is seen to stand.
    Pull(Pull),
    /// Excite the windings without turning the motor, once it is seen to stand.
    Excite(Excitation),
}

/// State of the inverter switches until the next period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bridge {
    /// All switches off.
    Off,
    /// Low sides on for this share of the period around the sample, all else off: charges the supplies of the
    /// high-side drivers.
    Charge(Duty),
    /// All low sides on.
    Brake,
    /// Each phase switches, with its high side on for this share of the period.
    Duty([Duty; 3]),
    /// Like `Duty`, but a phase with `None` has both switches off.
    Legs([Option<Duty>; 3]),
}

impl Setpoint {
    /// Returns a number for each kind.
    pub(super) fn kind(self) -> u8 {
        match self {
            Self::Stop => 0,
            Self::Zero => 1,
            Self::Fault(_) => 2,
            Self::Speed(_) => 3,
            Self::Torque(_) => 4,
            Self::Voltage(_) => 5,
            Self::Tone(_) => 6,
            Self::Test(_) => 7,
            Self::Pull(_) => 8,
            Self::Excite(_) => 9,
        }
    }

    /// Returns the direction in which it asks the motor to turn. Backward needs `both_ways`, or a test, which may
    /// go either way.
    pub(super) fn rotation(self, both_ways: bool) -> Rotation {
        let sign = match self {
            Self::Speed(speed) => speed.to_bits(),
            Self::Torque(current) | Self::Test(current) => current.to_bits(),
            Self::Voltage(share) => share.to_bits(),
            Self::Stop
            | Self::Zero
            | Self::Fault(_)
            | Self::Tone(_)
            | Self::Pull(_)
            | Self::Excite(_) => 0,
        };
        if sign > 0 {
            Rotation::Forward
        } else if sign < 0 && (both_ways || matches!(self, Self::Test(_))) {
            Rotation::Backward
        } else {
            Rotation::Rest
        }
    }

    /// Returns this set-point as seen by a motor that turns the other way.
    pub(super) fn mirrored(self) -> Self {
        match self {
            Self::Speed(speed) => Self::Speed(speed.saturating_neg()),
            Self::Torque(current) => Self::Torque(current.saturating_neg()),
            Self::Voltage(share) => Self::Voltage(share.saturating_neg()),
            Self::Test(current) => Self::Test(current.saturating_neg()),
            Self::Stop
            | Self::Zero
            | Self::Fault(_)
            | Self::Tone(_)
            | Self::Pull(_)
            | Self::Excite(_) => self,
        }
    }
}

/// The direction in which a set-point asks the motor to turn, relative to the configured one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rotation {
    /// Not at all.
    Rest,
    /// In the configured direction.
    Forward,
    /// The other way.
    Backward,
}

/// Returns the Hall sensors in the control's phase order.
pub(super) fn hall(sample: &Sample, swapped: bool) -> u8 {
    if swapped {
        sample.hall & 1 | (sample.hall & 2) << 1 | (sample.hall & 4) >> 1
    } else {
        sample.hall
    }
}

/// Swaps phases b and c for a motor that turns the other way.
pub(super) fn in_order<T>(swapped: bool, [a, b, c]: [T; 3]) -> [T; 3] {
    if swapped { [a, c, b] } else { [a, b, c] }
}
