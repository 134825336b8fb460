//! The product that keeps the top half.

use core::ops::{Add, Sub};

use fixed::FixedI32;
use fixed::types::I0F32;
use fixed::types::extra::{Diff, Sum, U32, Unsigned};

use super::Number;

/// π/8: a factor of products must be below a half.
pub const EIGHTH_PI: I0F32 = I0F32::lit("0.392699081699");

/// The top 32 bits of the 64-bit product of two fixed-point numbers.
pub trait TopProduct<Rhs> {
    /// The product's type: its fraction bits are the sum of the factors', less 32.
    type Output;

    /// Multiplies and keeps the top half, rounding towards minus infinity.
    ///
    /// It cannot overflow: two 32-bit factors have a 64-bit product.
    fn top(self, rhs: Rhs) -> Self::Output;
}

impl<A, B> TopProduct<FixedI32<B>> for FixedI32<A>
where
    A: Unsigned + Add<B>,
    B: Unsigned,
    Sum<A, B>: Unsigned + Sub<U32>,
    Diff<Sum<A, B>, U32>: Unsigned,
{
    type Output = FixedI32<Diff<Sum<A, B>, U32>>;

    #[inline(always)] // one instruction
    fn top(self, rhs: FixedI32<B>) -> Self::Output {
        let product = i64::from(self.to_bits()) * i64::from(rhs.to_bits());
        FixedI32::from_bits((product >> 32) as i32)
    }
}

/// Multiply-accumulate with the top half of the product: one SMMLA or SMMLS each.
///
/// The sum wraps: the caller knows the range of what it adds.
pub trait TopSum: Number {
    /// self + a·b.
    #[inline(always)] // one instruction
    #[must_use]
    fn plus_top<A, B>(self, a: A, b: B) -> Self
    where
        A: TopProduct<B, Output = Self>,
    {
        Self::from_bits(self.to_bits().wrapping_add(a.top(b).to_bits()))
    }

    /// self − a·b.
    #[inline(always)] // one instruction
    #[must_use]
    fn minus_top<A, B>(self, a: A, b: B) -> Self
    where
        A: Number + TopProduct<B, Output = Self>,
        B: Number,
    {
        Self::from_bits(less(self.to_bits(), a.to_bits(), b.to_bits()))
    }
}

impl<T: Number> TopSum for T {}

/// Returns the top half of 2^32·sum − a·b, as SMMLS does: the product rounds up.
#[inline(always)] // one instruction
pub(super) fn less(sum: i32, a: i32, b: i32) -> i32 {
    let whole = i64::from(sum) << 32;
    (whole.wrapping_sub(i64::from(a) * i64::from(b)) >> 32) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use fixed::types::{I0F32, I4F28};

    #[test]
    fn sums_with_a_product() {
        let (half, three) = (I0F32::from_num(-0.5), I4F28::from_num(3));
        let seven = I4F28::from_num(7);
        assert_eq!(seven.plus_top(half, three), I4F28::from_num(5.5));
        // 8.5 wraps.
        assert_eq!(seven.minus_top(half, three), I4F28::from_num(-7.5));
    }

    #[test]
    fn the_compiler_keeps_the_fraction_bits() {
        let quarter = I0F32::from_num(0.25);
        let three = I4F28::from_num(3);
        let product: I4F28 = quarter.top(three);
        assert_eq!(product, I4F28::from_num(0.75));
    }

    #[test]
    fn extremes_do_not_overflow() {
        let product = I0F32::MIN.top(I0F32::MIN);
        assert_eq!(product, I0F32::from_num(0.25));
    }
}
