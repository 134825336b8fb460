//! Square root without a division.

use super::Number;

/// 1/√m − 1 at the middle of each section of m in 1/4..1, with 8 fraction bits: accurate to 0.9 %.
static RECIPROCAL_ROOT: [u8; 96] = reciprocal_root_table();

/// Returns √(x² + y²), saturated.
///
/// The error is at most 2^-25 of the value plus one bit.
pub fn magnitude<T: Number>(x: T, y: T) -> T {
    T::from_bits(hypotenuse(x.to_bits(), y.to_bits()))
}

/// Returns the other leg of a right triangle, √(c² − a²), or 0 if the leg `a` is longer than `c`.
///
/// The error is that of [`magnitude`].
pub fn other_leg<T: Number>(c: T, a: T) -> T {
    T::from_bits(leg(c.to_bits(), a.to_bits()))
}

/// Shared by all types, like [`leg`].
#[inline(never)]
fn hypotenuse(x: i32, y: i32) -> i32 {
    let length = root(square(x) + square(y));
    length.min(i32::MAX as u32) as i32
}

#[inline(never)] // as above
fn leg(c: i32, a: i32) -> i32 {
    // Below 2^31, since c² is at most 2^62.
    root(square(c).saturating_sub(square(a))).min(i32::MAX as u32) as i32
}

fn square(x: i32) -> u64 {
    let x = u64::from(x.unsigned_abs());
    x * x
}

/// Returns √x, rounded down; the error is at most 2^-25 of the value plus one bit.
///
/// The reciprocal root comes from a table and two Newton steps, which need only products.
fn root(x: u64) -> u32 {
    if x == 0 {
        return 0;
    }
    let even = x.leading_zeros() & !1;
    // Of 32-bit words: the chip has no shift of 64 bits.
    let (high, low) = ((x >> 32) as u32, x as u32);
    let m = if even < 32 {
        high << even | low >> 1 >> (31 - even)
    } else {
        low << (even - 32)
    };
    let mut y = (1 << 30) + (u32::from(RECIPROCAL_ROOT[(m >> 25) as usize - 32]) << 22);
    for _ in 0..2 {
        // y·(3 − m·y²)/2, with 30 fraction bits in y and 32 in m.
        let m_y2 = top(top(y, y), m);
        y = top(y, (3 << 28) - m_y2) << 3;
    }
    // √m = m·(1/√m) with 30 fraction bits; 32 are wanted before undoing the shift.
    let root = top(m, y);
    match even / 2 {
        small @ 0..2 => root << (2 - small),
        large => root >> (large - 2),
    }
}

fn top(a: u32, b: u32) -> u32 {
    ((u64::from(a) * u64::from(b)) >> 32) as u32
}

const fn reciprocal_root_table() -> [u8; 96] {
    let mut table = [0; 96];
    let mut i = 0;
    while i < 96 {
        let m = (i as f64 + 32.5) / 128.0;
        // Newton's iteration from 1 converges for m in 1/4..1.
        let mut y = 1.0;
        let mut n = 0;
        while n < 40 {
            y *= 1.5 - 0.5 * m * y * y;
            n += 1;
        }
        table[i] = ((y - 1.0) * 256.0 + 0.5) as u8;
        i += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use fixed::types::I4F28;
    use proptest::prelude::*;

    fn bound(value: f64) -> f64 {
        value * 2.98e-8 + 1.1
    }

    proptest! {
        #[test]
        fn magnitude_is_the_length(x: i32, y: i32, shift in 0..31) {
            let (x, y) = (x >> shift, y >> shift);
            let got = f64::from(magnitude(I4F28::from_bits(x), I4F28::from_bits(y)).to_bits());
            let wanted = f64::from(x).hypot(f64::from(y)).min(f64::from(i32::MAX));
            prop_assert!((got - wanted).abs() < bound(wanted), "{got} for {wanted}");
        }

        #[test]
        fn the_other_leg_completes_the_square(a in 0..i32::MAX, c in 0..i32::MAX) {
            let got = f64::from(other_leg(I4F28::from_bits(c), I4F28::from_bits(a)).to_bits());
            let wanted = (f64::from(c).powi(2) - f64::from(a).powi(2)).max(0.0).sqrt();
            prop_assert!((got - wanted).abs() < bound(wanted), "{got} for {wanted}");
        }
    }

    #[test]
    fn corners() {
        assert_eq!(magnitude(I4F28::ZERO, I4F28::ZERO), I4F28::ZERO);
        assert_eq!(magnitude(I4F28::MIN, I4F28::MIN), I4F28::MAX);
        assert_eq!(other_leg(I4F28::ONE, I4F28::MIN), I4F28::ZERO);
    }
}
