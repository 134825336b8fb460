//! The properties of a number that the arithmetic needs.

use fixed::FixedI32;
use fixed::types::extra::Unsigned;

/// A signed number of 32 bits whose fraction bits are part of its type: a [`FixedI32`], or a
/// [`Quantity`](super::Quantity), which has a dimension besides.
pub trait Number: Copy {
    /// The fraction bits.
    type Frac: Unsigned;

    /// The number of these bits.
    fn from_bits(bits: i32) -> Self;

    /// Its bits.
    fn to_bits(self) -> i32;
}

// Inlined: each is no instruction at all.
impl<F: Unsigned> Number for FixedI32<F> {
    type Frac = F;

    fn from_bits(bits: i32) -> Self {
        Self::from_bits(bits)
    }

    fn to_bits(self) -> i32 {
        self.to_bits()
    }
}
