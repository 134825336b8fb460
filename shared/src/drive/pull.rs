//! Which half-bridges a self-test pulls.

use crate::trace::Trace;

/// Which half-bridges a self-test pulls to the supply's poles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Pull {
    /// Nothing: all switches are off.
    #[default]
    Open = 0,
    /// Leg a to the supply: its high side on for more and more of the period and at last for all of it, the
    /// low side for the rest. The others are off.
    UpA = 1,
    /// Leg b, likewise.
    UpB = 2,
    /// Leg c, likewise.
    UpC = 3,
    /// Leg a up to a quarter of the period, with the low side of leg b on: a current flows into the motor by
    /// the one and back by the other.
    ThroughA = 4,
    /// Leg b, and c, likewise.
    ThroughB = 5,
    /// Leg c, and a, likewise.
    ThroughC = 6,
}

impl Pull {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 7] = [
        Self::Open,
        Self::UpA,
        Self::UpB,
        Self::UpC,
        Self::ThroughA,
        Self::ThroughB,
        Self::ThroughC,
    ];

    /// The one of a number; of any other, the first.
    pub const fn from_number(number: u8) -> Self {
        // Written out: a look-up would be a table in flash.
        match number {
            1 => Self::UpA,
            2 => Self::UpB,
            3 => Self::UpC,
            4 => Self::ThroughA,
            5 => Self::ThroughB,
            6 => Self::ThroughC,
            _ => Self::Open,
        }
    }

    /// Returns true if the low side of the next leg is on.
    pub const fn is_through(self) -> bool {
        self as u8 >= Self::ThroughA as u8
    }

    /// The leg that is pulled, 0, 1, 2 for a, b, c.
    pub const fn leg(self) -> u8 {
        match self {
            Self::Open | Self::UpA | Self::ThroughA => 0,
            Self::UpB | Self::ThroughB => 1,
            Self::UpC | Self::ThroughC => 2,
        }
    }
}

impl Trace for Pull {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        out(*self as u32);
    }
}
