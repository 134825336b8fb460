//! When a fault comes: what the throttle asks for until then, and what the motor does there.

use serde::Serialize;

/// What the motor does when the fault comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Moment {
    /// It stands after a flight, its low sides on.
    Standstill,
    /// It is ramped up from standstill.
    Start,
    /// The throttle is at its least.
    Idle,
    /// At half throttle.
    Half,
    /// At full throttle.
    Full,
    /// It is being stopped from full throttle.
    Braking,
}

/// The throttle that turns the motor as slowly as it can be asked to; flight controllers idle there.
const IDLE: f64 = 0.055;

/// When the throttle first opens, s: armed takes 0.3.
pub(super) const OPENS_S: f64 = 0.4;

impl Moment {
    /// All, from rest to full speed and back.
    pub const ALL: [Self; 6] = [
        Self::Standstill,
        Self::Start,
        Self::Idle,
        Self::Half,
        Self::Full,
        Self::Braking,
    ];

    /// Its name.
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

    /// Throttle at first, and from a later time on, s.
    pub(super) fn throttle(self) -> (f64, Option<(f64, f64)>) {
        match self {
            Self::Standstill => (0.5, Some((1.6, 0.0))),
            Self::Start | Self::Half => (0.5, None),
            Self::Idle => (IDLE, None),
            Self::Full => (1.0, None),
            Self::Braking => (1.0, Some((3.0, 0.0))),
        }
    }

    /// Whether the motor is to turn when the fault comes and behind it.
    pub fn drives(self) -> bool {
        !matches!(self, Self::Standstill | Self::Braking)
    }

    /// Whether the rotor's voltage between the lines, 17.8 V, is above `LIM_BUS_V_MIN`, 9 V.
    pub(super) fn is_fast(self) -> bool {
        matches!(self, Self::Full | Self::Braking)
    }

    /// When the fault comes, s: the start's ramp by either drive; speeds that are settled; the motor braked to a
    /// stand; 20 ms of braking, a twentieth of all.
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
