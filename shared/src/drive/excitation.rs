//! The identification's excitation of a standing motor's windings.

use siskin_params::parts::Identification;
use siskin_units::{Current, traced};

traced! {
    /// Direction of the square wave.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum Ripple {
        /// No square wave.
        #[default]
        None,
        /// Along the current, which is along the flux of the rotor it has aligned.
        Along,
        /// Across the current.
        Across,
    }
}

/// The excitation, packed into 24 bits to keep the set-point small in every period: the phase in bits 23 and 22,
/// the square wave in 21 and 20, the current's upper bits below.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Excitation {
    word: u32,
    part: Identification,
}

const BITS: u32 = 24;
const PHASE_SHIFT: u32 = 22;
const RIPPLE_SHIFT: u32 = 20;
const CURRENT_SHIFT: u32 = 12;

impl Excitation {
    /// Creates a current along the axis of a phase, 0, 1, 2 for a, b, c, and a square wave. Drops the current's
    /// lower 12 bits.
    pub const fn new(part: Identification, phase: u8, current: Current, ripple: Ripple) -> Self {
        let current = (current.to_bits() as u32) >> CURRENT_SHIFT;
        let word = (phase as u32) << PHASE_SHIFT | (ripple as u32) << RIPPLE_SHIFT | current;
        Self { word, part }
    }

    /// Returns the phase along whose axis the current flows.
    pub const fn phase(self) -> u8 {
        (self.word >> PHASE_SHIFT) as u8
    }

    /// Returns the current.
    pub const fn current(self) -> Current {
        let current = self.word & ((1 << RIPPLE_SHIFT) - 1);
        Current::from_bits((current << CURRENT_SHIFT) as i32)
    }

    /// Returns the square wave's direction, if there is one.
    pub const fn ripple(self) -> Ripple {
        match self.word >> RIPPLE_SHIFT & 3 {
            1 => Ripple::Along,
            2 => Ripple::Across,
            _ => Ripple::None,
        }
    }

    /// Returns the lower 24 bits of a word.
    pub const fn to_word(self) -> u32 {
        self.word
    }

    /// Restores the one of [`to_word`](Self::to_word), if this build has the part.
    pub fn from_word(word: u32) -> Option<Self> {
        Identification::get().map(|part| Self {
            word: word & ((1 << BITS) - 1),
            part,
        })
    }
}
