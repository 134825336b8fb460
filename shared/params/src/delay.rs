//! The delay from a sample to the voltage computed from it.

use siskin_units::{Angle, Speed, Voltage};

use crate::parts;

/// Control periods from a sample to the voltage computed from it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Delay {
    /// No delay.
    None(parts::Bench),
    /// Half a period.
    Half(parts::Bench),
    /// One period: one preloaded duty update per period.
    #[default]
    One,
}

impl Delay {
    /// Delay compensation: returns the angle by which the rotor's frame turns from the sample to
    /// the middle of the voltage, (0.5 + delay) periods at this speed.
    pub fn advance(self, speed: Speed) -> Angle {
        let half = speed.over_half_period();
        match self {
            Self::None(_) => half,
            Self::Half(_) => speed.over_period(),
            Self::One => speed.over_period().wrapping_add(half),
        }
    }

    /// Returns the mean voltage between this sample and the next, from the current and the previous
    /// command.
    pub fn applied(self, now: Voltage, before: Voltage) -> Voltage {
        match self {
            Self::None(_) => now,
            Self::Half(_) => (now + before) >> 1,
            Self::One => before,
        }
    }
}
