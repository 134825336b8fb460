//! What the arithmetic needs to know of a number.

use fixed::FixedI32;
use fixed::types::extra::Unsigned;

/// A signed 32-bit number with its fraction bits in the type: a [`FixedI32`], or a
/// [`Quantity`](super::Quantity), which also has a dimension.
pub trait Number: Copy {
    /// The fraction bits.
    type Frac: Unsigned;

    /// Creates a number from its bits.
    fn from_bits(bits: i32) -> Self;

    /// Returns its bits.
    fn to_bits(self) -> i32;
}

// Inlined: each compiles to no instruction.
impl<F: Unsigned> Number for FixedI32<F> {
    type Frac = F;

    fn from_bits(bits: i32) -> Self {
        Self::from_bits(bits)
    }

    fn to_bits(self) -> i32 {
        self.to_bits()
    }
}
