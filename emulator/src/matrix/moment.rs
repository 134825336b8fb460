//! When a fault occurs: the throttle until then, and what the motor does.

use serde::Serialize;

/// What the motor does when the fault occurs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Moment {
    /// It stands after a flight, with the low sides on.
    Standstill,
    /// It is being ramped up from standstill.
    Start,
    /// At idle throttle.
    Idle,
    /// At half throttle.
    Half,
    /// At full throttle.
    Full,
    /// It is being stopped from full throttle.
    Braking,
}

/// The throttle at which the motor turns as slowly as it can be asked to; flight controllers idle there.
const IDLE: f64 = 0.055;

/// When the throttle first opens, s: arming takes 0.3.
pub(super) const OPENS_S: f64 = 0.4;

impl Moment {
    /// All moments, from rest to full speed and back.
    pub const ALL: [Self; 6] = [
        Self::Standstill,
        Self::Start,
        Self::Idle,
        Self::Half,
        Self::Full,
        Self::Braking,
    ];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Standstill => "standstill",
            Self::Start => "start",
            Self::Idle => "idle",
            Self::Half => "half",
            Self::Full => "full",
            Self::Braking => "braking",
        }
    }

    /// Returns the initial throttle, and the one from a later time on, s.
    pub(super) fn throttle(self) -> (f64, Option<(f64, f64)>) {
        match self {
            Self::Standstill => (0.5, Some((1.6, 0.0))),
            Self::Start | Self::Half => (0.5, None),
            Self::Idle => (IDLE, None),
            Self::Full => (1.0, None),
            Self::Braking => (1.0, Some((3.0, 0.0))),
        }
    }

    /// Returns true if the motor is to turn when the fault occurs and afterwards.
    pub fn drives(self) -> bool {
        !matches!(self, Self::Standstill | Self::Braking)
    }

    /// Returns true if the rotor's line-to-line voltage, 17.8 V, exceeds `LIM_BUS_V_MIN`, 9 V.
    pub(super) fn is_fast(self) -> bool {
        matches!(self, Self::Full | Self::Braking)
    }

    /// Returns when the fault occurs, s: during the start's ramp with either drive; at settled speeds; with the motor
    /// braked to standstill; 20 ms into braking, a twentieth of it.
    pub(super) fn fault_s(self) -> f64 {
        match self {
            Self::Standstill => 2.6,
            Self::Start => 0.75,
            Self::Idle => 2.0,
            Self::Half => 2.0,
            Self::Full => 2.9,
            Self::Braking => 3.02,
        }
    }
}
