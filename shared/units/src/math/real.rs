//! Conversion between fixed and floating point.

use fixed::types::extra::Unsigned;
use fixed::{FixedI64, FixedU32};

use super::Number;

/// Converts like the [`fixed`] crate's `saturating_from_num` and `to_num`, but NaN becomes 0 and nothing panics. It
/// takes a tenth of the flash: single precision only, and one copy for all types.
pub trait Real {
    /// Rounds to the nearest number, ties to even; saturates.
    fn from_f32(value: f32) -> Self;

    /// Returns the nearest float.
    fn to_f32(self) -> f32;
}

impl<T: Number> Real for T {
    fn from_f32(value: f32) -> Self {
        Self::from_bits(whole(value, T::Frac::I32))
    }

    fn to_f32(self) -> f32 {
        self.to_bits() as f32 * power_of_two(-T::Frac::I32)
    }
}

impl<F: Unsigned> Real for FixedU32<F> {
    fn from_f32(value: f32) -> Self {
        Self::from_bits(whole_unsigned(value, F::I32))
    }

    fn to_f32(self) -> f32 {
        self.to_bits() as f32 * power_of_two(-F::I32)
    }
}

impl<F: Unsigned> Real for FixedI64<F> {
    fn from_f32(value: f32) -> Self {
        Self::from_bits(whole_long(value, F::I32))
    }

    fn to_f32(self) -> f32 {
        self.to_bits() as f32 * power_of_two(-F::I32)
    }
}

/// Returns the bits of a number with this many binary places. Never inlined: every coefficient calls it.
#[inline(never)]
fn whole(value: f32, places: i32) -> i32 {
    round(value * power_of_two(places)) as i32
}

/// Like [`whole`], unsigned.
#[inline(never)]
fn whole_unsigned(value: f32, places: i32) -> u32 {
    // A float's digits beyond 32 bits are zeros.
    round(value * power_of_two(places)) as u32
}

/// Like [`whole`], for 64 bits. In halves, since the FPU converts 32 bits and the compiler's 64-bit function is twice
/// as long.
#[inline(never)]
fn whole_long(value: f32, places: i32) -> i64 {
    let magnitude = value.abs();
    let high = (magnitude * power_of_two(places - 32)) as u32;
    // Exact: a float has fewer bits than a half.
    let rest = magnitude - high as f32 * power_of_two(32 - places);
    let low = round(rest * power_of_two(places)) as u32;
    match (high > i32::MAX as u32, value < 0.0) {
        (true, false) => i64::MAX,
        (true, true) => i64::MIN,
        (false, negative) => {
            let bits = i64::from(high) << 32 | i64::from(low);
            if negative { -bits } else { bits }
        }
    }
}

/// Rounds to the nearest whole number, ties to even.
#[inline(never)] // many call it
pub fn round(value: f32) -> f32 {
    // From there on floats are whole, and a sum is rounded to one.
    const WHOLE: f32 = (1 << 23) as f32;
    let whole = WHOLE.copysign(value);
    if value.abs() < WHOLE {
        value + whole - whole
    } else {
        value
    }
}

/// Returns 2^`power`, `power` being at most the bits of a type: products with it are exact.
const fn power_of_two(power: i32) -> f32 {
    f32::from_bits(((127 + power) << 23) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fixed::types::{I0F32, I4F28, I16F16, I36F28, U0F32, U1F31};
    use proptest::prelude::*;

    /// Both ways of making and of reading a number agree.
    macro_rules! agree {
        ($($kind:ty),*; $value:expr) => {$(
            let made = <$kind>::from_f32($value);
            prop_assert_eq!(made, <$kind>::saturating_from_num($value), "{:e}", $value);
            prop_assert_eq!(made.to_f32().to_bits(), made.to_num::<f32>().to_bits());
        )*};
    }

    proptest! {
        #[test]
        fn numbers_are_those_of_the_fixed_crate(
            value in any::<f32>().prop_filter("a number", |value| !value.is_nan()),
            small in -20.0..20_f32,
            bits: i32,
        ) {
            for value in [value, small] {
                agree!(I0F32, I4F28, I16F16, I36F28, U0F32, U1F31; value);
            }
            let number = I4F28::from_bits(bits);
            prop_assert_eq!(number.to_f32(), number.to_num::<f32>());
        }
    }

    #[test]
    fn halves_go_to_the_even_number_and_ends_hold() {
        let bit = I16F16::DELTA.to_f32();
        for (bits, wanted) in [(0.5, 0), (1.5, 2), (-2.5, -2), (2.501, 3)] {
            assert_eq!(I16F16::from_f32(bits * bit), I16F16::from_bits(wanted));
        }
        assert_eq!(I4F28::from_f32(f32::INFINITY), I4F28::MAX);
        assert_eq!(I4F28::from_f32(-8.5), I4F28::MIN);
        assert_eq!(U1F31::from_f32(-1.0), U1F31::ZERO);
        assert_eq!(I0F32::from_f32(f32::NAN), I0F32::ZERO);
    }
}
