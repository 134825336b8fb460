//! Inputs and output of a control period: sample, set-point, bridge.

use fixed::types::I1F31;

use super::excitation::Excitation;
use super::pull::Pull;
use crate::protection::Fault;
use crate::units::{AdcCounts, Current, Duty, Speed};

/// The converter's readings for one control period.
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

/// The demand on the motor; it comes from something that may turn it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setpoint {
    /// No drive: coast or brake, as configured.
    Stop,
    /// No drive, because the throttle is at zero: that also ends a latched fault.
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
    /// [`PITCH_MAX`](super::config::tone::PITCH_MAX); zero is a pause between two notes.
    Tone(Speed),
    /// Hold this current i_q for a test; the start uses no more than a test may either.
    Test(Current),
    /// Pull half-bridges to the supply's poles without turning the motor, once it is seen to stand.
    Pull(Pull),
    /// Excite the windings without turning the motor, once it is seen to stand.
    Excite(Excitation),
}

/// State of the inverter's switches until the next period.
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

impl Setpoint {
    /// A number for each kind.
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

    /// Which way it asks the motor to turn. The other way is for who has asked for `both_ways`, or for a test,
    /// which is of either direction.
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

    /// This set-point as seen by a motor that turns the other way.
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

/// Which way a set-point asks the motor to turn, against the configured direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rotation {
    /// Not at all.
    Rest,
    /// In the configured direction.
    Forward,
    /// The other way.
    Backward,
}

/// The Hall sensors in the order of the control's phases.
pub(super) fn hall(sample: &Sample, swapped: bool) -> u8 {
    if swapped {
        sample.hall & 1 | (sample.hall & 2) << 1 | (sample.hall & 4) >> 1
    } else {
        sample.hall
    }
}

/// Phases b and c change places where the motor turns the other way than a, b, c.
pub(super) fn in_order<T>(swapped: bool, [a, b, c]: [T; 3]) -> [T; 3] {
    if swapped { [a, c, b] } else { [a, b, c] }
}
