//! From the sample to the voltage that it leads to.

use crate::units::{Angle, Speed, Voltage};

/// Periods between the sample and the voltage that it leads to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Delay {
    /// At once.
    #[default]
    None,
    /// Half a period later.
    Half,
    /// A period later: one duty update a period, preloaded.
    One,
}

impl Delay {
    /// Delay compensation: the angle by which the rotor's frame turns from the sample to the middle
    /// of the voltage, (0.5 + delay) periods at this speed.
    pub fn advance(self, speed: Speed) -> Angle {
        let half = speed.over_half_period();
        match self {
            Self::None => half,
            Self::Half => speed.over_period(),
            Self::One => speed.over_period().wrapping_add(half),
        }
    }

    /// The voltage between this sample and the next, of what is commanded now and what was before.
    pub fn applied(self, now: Voltage, before: Voltage) -> Voltage {
        match self {
            Self::None => now,
            Self::Half => (now + before) >> 1,
            Self::One => before,
        }
    }
}
