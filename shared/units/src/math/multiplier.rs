//! A constant factor whose range is part of its type.

use core::marker::PhantomData;

use fixed::types::extra::Unsigned;

use super::{Number, gain};
use crate::trace::Trace;

/// A factor that turns an `A` into a `B`.
///
/// Its magnitude is below 2^(a − b − 1) for a and b fraction bits, so the product is one SMMUL, and
/// with a sum one SMMLA or SMMLS. For another range, choose other fraction bits, or a
/// [`super::Gain`], whose range is its own, at four times the cost.
#[derive(Debug)]
pub struct Multiplier<A, B> {
    bits: i32,
    kind: PhantomData<(A, B)>,
}

impl<A, B> Clone for Multiplier<A, B> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<A, B> Copy for Multiplier<A, B> {}

impl<A, B> PartialEq for Multiplier<A, B> {
    fn eq(&self, other: &Self) -> bool {
        self.bits == other.bits
    }
}

impl<A, B> Default for Multiplier<A, B> {
    fn default() -> Self {
        Self::from_bits(0)
    }
}

impl<A, B> Multiplier<A, B> {
    /// Creates the factor `bits`/2^32, in bits out per bit in.
    pub const fn from_bits(bits: i32) -> Self {
        Self {
            bits,
            kind: PhantomData,
        }
    }

    /// Returns the factor's bits, as [`Multiplier::from_bits`] takes them.
    pub const fn to_bits(self) -> i32 {
        self.bits
    }
}

impl<A, B> Trace for Multiplier<A, B> {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        self.bits.trace(out);
    }
}

impl<A: Number, B: Number> Multiplier<A, B> {
    /// Creates the factor `k`, or returns `None` if its magnitude does not fit or is not finite.
    ///
    /// Called when the configuration is built, never in a control period.
    pub fn new(k: f32) -> Option<Self> {
        match gain::parts(k, B::Frac::I32 - A::Frac::I32)? {
            (mantissa, 0) => Some(Self::from_bits(mantissa)),
            _ => None,
        }
    }

    /// Returns the product with `x`, rounded towards minus infinity.
    pub fn of(self, x: A) -> B {
        B::from_bits(((i64::from(self.bits) * i64::from(x.to_bits())) >> 32) as i32)
    }

    /// Returns `sum` plus the product with `x`. It wraps: the caller knows the range of both.
    pub fn added(self, sum: B, x: A) -> B {
        B::from_bits(sum.to_bits().wrapping_add(self.of(x).to_bits()))
    }

    /// Returns `sum` minus the product with `x`, likewise.
    pub fn taken(self, sum: B, x: A) -> B {
        B::from_bits(super::product::less(sum.to_bits(), self.bits, x.to_bits()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fixed::types::{I4F28, I8F24};

    #[test]
    fn the_range_is_that_of_the_fraction_bits() {
        assert!(Multiplier::<I4F28, I4F28>::new(0.49).is_some());
        assert_eq!(Multiplier::<I4F28, I4F28>::new(0.5), None);
        assert!(Multiplier::<I4F28, I8F24>::new(-7.9).is_some());
        assert_eq!(Multiplier::<I4F28, I8F24>::new(8.0), None);
        assert_eq!(Multiplier::<I4F28, I4F28>::new(f32::NAN), None);
    }

    #[test]
    fn sums_are_right_to_a_bit() {
        let gain = Multiplier::<I4F28, I8F24>::new(-3.3).expect("in range");
        let sum = I8F24::from_num(20);
        for x in [-7.5, -0.001, 0.0, 0.3, 7.9] {
            let product = -3.3 * x;
            let x = I4F28::from_num(x);
            for (got, wanted) in [
                (gain.of(x), product),
                (gain.added(sum, x), 20.0 + product),
                (gain.taken(sum, x), 20.0 - product),
            ] {
                assert!((got.to_num::<f64>() - wanted).abs() < 2e-6, "{got}");
            }
        }
    }
}
