//! A constant factor that carries its own range.

mod factor;

use core::marker::PhantomData;

use fixed::types::extra::Unsigned;

use super::Number;
use factor::Factor;

/// A factor that turns an `A` into a `B`: a current into a voltage, say.
///
/// It stores the largest mantissa that fits and its own power of two, which covers 2^-31 to 2^30
/// (in bits out per bit in) with 30 bits of precision near the top of each range.
#[derive(Debug)]
pub struct Gain<A, B> {
    factor: Factor,
    kind: PhantomData<(A, B)>,
}

impl<A, B> Clone for Gain<A, B> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<A, B> Copy for Gain<A, B> {}

impl<A, B> PartialEq for Gain<A, B> {
    fn eq(&self, other: &Self) -> bool {
        self.factor == other.factor
    }
}

impl<A: Number, B: Number> Default for Gain<A, B> {
    fn default() -> Self {
        Self::ZERO
    }
}

impl<A: Number, B: Number> Gain<A, B> {
    /// The zero gain.
    pub const ZERO: Self = Self::from_parts(0, 0);

    /// Creates the gain `k`, or returns `None` if its magnitude does not fit or is not finite.
    ///
    /// Called when the configuration is built, never in a control period.
    pub fn new(k: f32) -> Option<Self> {
        let (mantissa, shift) = parts(k, B::Frac::I32 - A::Frac::I32)?;
        Some(Self::from_parts(mantissa, shift))
    }

    /// Creates the gain `mantissa·2^shift/2^32`, in bits out per bit in; the shift is at most 30.
    #[inline(always)] // in each period
    pub const fn from_parts(mantissa: i32, shift: u32) -> Self {
        Self {
            factor: Factor::new(mantissa, shift),
            kind: PhantomData,
        }
    }

    /// Returns the product with `x`.
    ///
    /// The result wraps if it exceeds its type: the caller bounds `x`, or uses
    /// [`Gain::held`].
    #[inline(always)] // in each period
    pub fn apply(self, x: A) -> B {
        B::from_bits(self.factor.wrapping(x.to_bits()))
    }

    /// Returns the product with `x`, saturated.
    #[inline] // where that is short: a call each costs the longest period 10 instructions, a copy each the flash 0.5 KB
    pub fn held(self, x: A) -> B {
        B::from_bits(self.factor.saturating(x.to_bits()))
    }
}

/// Mantissa bits of a float, including the implicit one.
const MANTISSA_BITS: i32 = 24;

/// Returns the [`Gain::from_parts`] of `k·2^exponent`, or `None` if there are none.
///
/// Shared by all types and never inlined: the chip calls it for every coefficient.
#[inline(never)]
pub fn parts(k: f32, exponent: i32) -> Option<(i32, u32)> {
    if !k.is_finite() {
        return None;
    }
    let bits = k.to_bits();
    // Numbers too small to have the implicit one end up as 0.
    let mantissa = (1 << (MANTISSA_BITS - 1)) | (bits & ((1 << (MANTISSA_BITS - 1)) - 1));
    // The binary point stands behind the mantissa; 32 more for the bits that a product drops.
    let power = (bits << 1 >> MANTISSA_BITS) as i32 - (127 + MANTISSA_BITS - 1) + exponent + 32;
    // The smallest shift that keeps the mantissa below half of 2^32 loses the fewest bits.
    let shift = (power - (31 - MANTISSA_BITS)).max(0);
    let left = power - shift;
    let magnitude = if left >= 0 {
        mantissa << left
    } else if left >= -MANTISSA_BITS {
        (mantissa + (1 << (-left - 1))) >> -left
    } else {
        0
    };
    let sign = if k < 0.0 { -1 } else { 1 };
    (shift <= 30).then(|| (sign * magnitude as i32, shift as u32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fixed::types::{I0F32, I4F28};

    #[test]
    fn small_and_large_factors_are_precise() {
        let x = I4F28::from_num(0.001);
        for k in [1e-6_f32, -0.3, 0.49, 1.0, -7.5, 1000.0] {
            let gain = Gain::<I4F28, I4F28>::new(k).expect("in range");
            let wanted = f64::from(k) * 0.001;
            let error = (gain.apply(x).to_num::<f64>() - wanted).abs();
            // One bit of 2^-28 before the shift, which is at most four times the factor.
            let bound = f64::from(k.abs()).max(0.5) * 1.5e-8;
            assert!(error <= bound, "{k}: {error}");
        }
    }

    #[test]
    fn fraction_bits_are_converted() {
        let gain = Gain::<I0F32, I4F28>::new(16.0).expect("in range");
        let y: I4F28 = gain.apply(I0F32::from_num(0.125));
        assert_eq!(y, I4F28::from_num(2));
    }

    #[test]
    fn parts_are_those_that_double_precision_finds() {
        let wanted = |k: f32, exponent: i32| {
            let mut scaled = f64::from(k) * 2_f64.powi(exponent + 32);
            let mut shift = 0;
            while scaled.abs() >= 2_147_483_647.0 {
                scaled *= 0.5;
                shift += 1;
            }
            (shift <= 30).then(|| (scaled.round() as i32, shift))
        };
        let mantissas = [0, 1, 0x2a_aaaa, 0x40_0000, 0x55_5555, 0x7f_ffff];
        for exponent in [-32, -4, 0, 3, 32] {
            for (power, mantissa) in (0..255).flat_map(|p| mantissas.map(|m| (p, m))) {
                for sign in [0, 1] {
                    let k = f32::from_bits(sign << 31 | power << 23 | mantissa);
                    assert_eq!(
                        parts(k, exponent),
                        wanted(k, exponent),
                        "{k:e}·2^{exponent}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert_eq!(Gain::<I4F28, I4F28>::new(f32::NAN), None);
        assert_eq!(Gain::<I4F28, I4F28>::new(1e30), None);
    }

    #[test]
    fn saturation_holds_the_ends() {
        let gain = Gain::<I4F28, I4F28>::new(100.0).expect("in range");
        assert!(gain.held(I4F28::from_num(1)) > I4F28::from_num(7.9));
        assert!(gain.held(I4F28::from_num(-1)) < I4F28::from_num(-7.9));
    }
}
