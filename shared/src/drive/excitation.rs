//! What an identification puts on the windings of a rotor that stands.

use crate::trace::traced;
use crate::units::Current;

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

/// What is put on the windings. In 24 bits, so that a set-point stays as small as it is for every period: the phase in
/// bits 23 and 22, the square wave in 21 and 20, the upper bits of the current below.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Excitation(u32);

const BITS: u32 = 24;
const PHASE_SHIFT: u32 = 22;
const RIPPLE_SHIFT: u32 = 20;
const CURRENT_SHIFT: u32 = 12;

impl Excitation {
    /// A current along the axis of a phase, 0, 1, 2 for a, b, c, and a square wave. The lower 12 bits of the current are
    /// left out.
    pub const fn new(phase: u8, current: Current, ripple: Ripple) -> Self {
        let current = (current.to_bits() as u32) >> CURRENT_SHIFT;
        Self((phase as u32) << PHASE_SHIFT | (ripple as u32) << RIPPLE_SHIFT | current)
    }

    /// The phase along whose axis the current flows.
    pub const fn phase(self) -> u8 {
        (self.0 >> PHASE_SHIFT) as u8
    }

    /// The current.
    pub const fn current(self) -> Current {
        let current = self.0 & ((1 << RIPPLE_SHIFT) - 1);
        Current::from_bits((current << CURRENT_SHIFT) as i32)
    }

    /// Which way the square wave goes, if there is one.
    pub const fn ripple(self) -> Ripple {
        match self.0 >> RIPPLE_SHIFT & 3 {
            1 => Ripple::Along,
            2 => Ripple::Across,
            _ => Ripple::None,
        }
    }

    /// The lower 24 bits of a word.
    pub const fn to_word(self) -> u32 {
        self.0
    }

    /// The one of [`to_word`](Self::to_word).
    pub const fn from_word(word: u32) -> Self {
        Self(word & ((1 << BITS) - 1))
    }
}
