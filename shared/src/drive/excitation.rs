//! What an identification puts on the windings of a rotor that stands.

use crate::trace::traced;
use crate::units::Current;

/// What is put on the windings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Excitation {
    /// The phase along whose axis the current flows, 0, 1, 2 for a, b, c.
    pub phase: u8,
    /// The current.
    pub current: Current,
    /// Which way the square wave goes, if there is one.
    pub ripple: Ripple,
}

traced! {
    /// Which way the square wave goes.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum Ripple {
        /// There is none.
        #[default]
        None,
        /// Along the current: along the flux of a rotor that it has aligned.
        Along,
        /// Across it.
        Across,
    }
}

/// The places of an excitation in a word of 24 bits: the phase in bits 23 and 22, the ripple in 21 and 20, the upper
/// bits of the current below.
const PHASE_SHIFT: u32 = 22;
const RIPPLE_SHIFT: u32 = 20;
const CURRENT_SHIFT: u32 = 12;

impl Excitation {
    /// The excitation in 24 bits; the lower 12 of the current are left out.
    pub const fn to_word(self) -> u32 {
        (self.phase as u32) << PHASE_SHIFT
            | (self.ripple as u32) << RIPPLE_SHIFT
            | (self.current.to_bits() as u32) >> CURRENT_SHIFT
    }

    /// The one of [`to_word`](Self::to_word).
    pub const fn from_word(word: u32) -> Self {
        let current = word & ((1 << RIPPLE_SHIFT) - 1);
        Self {
            phase: (word >> PHASE_SHIFT & 3) as u8,
            current: Current::from_bits((current << CURRENT_SHIFT) as i32),
            ripple: match word >> RIPPLE_SHIFT & 3 {
                1 => Ripple::Along,
                2 => Ripple::Across,
                _ => Ripple::None,
            },
        }
    }
}
