//! The half-bridges that a self-test pulls.

use siskin_units::trace::Trace;

/// Which half-bridge a self-test pulls to which supply rail.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Pull {
    /// None: all switches are off.
    #[default]
    Open = 0,
    /// Leg a to the supply: its high side is on for a growing share of the period, finally for all of it, and its
    /// low side for the rest. The other legs are off.
    UpA = 1,
    /// Leg b, in the same way.
    UpB = 2,
    /// Leg c, in the same way.
    UpC = 3,
    /// Leg a up to a quarter of the period, with the low side of leg b on: current flows into the motor through one
    /// and back through the other.
    ThroughA = 4,
    /// Legs b and c, in the same way.
    ThroughB = 5,
    /// Legs c and a, in the same way.
    ThroughC = 6,
}

impl Pull {
    /// All of them, in numerical order.
    pub const ALL: [Self; 7] = [
        Self::Open,
        Self::UpA,
        Self::UpB,
        Self::UpC,
        Self::ThroughA,
        Self::ThroughB,
        Self::ThroughC,
    ];

    /// Returns the one with this number, or the first for any other.
    pub const fn from_number(number: u8) -> Self {
        // Spelled out: a lookup would be a table in flash.
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

    /// Returns the pulled leg, 0, 1, 2 for a, b, c.
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
