//! Functions for computing coefficients that the FPU has no instruction for, or whose instruction the compiler does not
//! use: each takes a tenth of the flash of libm's and is within a few bits of it.

use core::f32::consts::LN_2;

/// √3, which the standard library lacks.
pub const SQRT_3: f32 = 1.732_050_8;

/// Returns √x for x above 0, within 2^-22 of its value.
#[inline(never)] // many call it
pub fn square_root(x: f32) -> f32 {
    // Halving the exponent, with a straight line between powers of two, is accurate to 4 %; each Newton step squares
    // the error.
    let mut root = f32::from_bits((x.to_bits() >> 1) + 0x1fbd_1df5);
    for _ in 0..3 {
        root = 0.5 * (root + x / root);
    }
    root
}

/// Returns 1 − e^(−x) for x from 0 to 10 000, within 2^-20 of its value: the share of a step that a first-order filter
/// covers in x time constants.
#[inline(never)] // many call it
pub fn settled(x: f32) -> f32 {
    // Over x/1024 the curve is nearly a straight line. Doubling the time covers the same share of what is left once
    // more.
    let part = x / 1024.0;
    let mut share = part / (1.0 + 0.5 * part);
    for _ in 0..10 {
        share *= 2.0 - share;
    }
    share
}

/// Returns ln x for x above 0, within 2^-18.
pub fn logarithm(x: f32) -> f32 {
    // The power of two that leaves √½ to √2, where 2·artanh((m − 1)/(m + 1)) takes three terms.
    const LEAST: u32 = core::f32::consts::FRAC_1_SQRT_2.to_bits();
    let exponent = (x.to_bits() as i32 - LEAST as i32) >> 23;
    let mantissa = f32::from_bits(x.to_bits().wrapping_sub((exponent << 23) as u32));
    let share = (mantissa - 1.0) / (mantissa + 1.0);
    let square = share * share;
    exponent as f32 * LN_2 + 2.0 * share * (1.0 + square * (1.0 / 3.0 + square * 0.2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn roots_are_right(x in 1e-30_f32..1e30) {
            let wanted = f64::from(x).sqrt();
            let error = (f64::from(square_root(x)) / wanted - 1.0).abs();
            prop_assert!(error < 2.4e-7, "{x:e}: {error:e}");
        }

        #[test]
        fn shares_are_right(log in -20.0_f32..9.0) {
            let x = log.exp();
            let wanted = -(-f64::from(x)).exp_m1();
            let error = (f64::from(settled(x)) / wanted - 1.0).abs();
            prop_assert!(error < 9.5e-7, "{x:e}: {error:e}");
        }
    }

    proptest! {
        #[test]
        fn logarithms_are_right(log in -20.0_f32..20.0) {
            let x = log.exp();
            let error = f64::from(logarithm(x)) - f64::from(x).ln();
            prop_assert!(error.abs() < 3.8e-6, "{x:e}: {error:e}");
        }
    }

    #[test]
    fn ends() {
        assert_eq!(SQRT_3, libm::sqrtf(3.0));
        assert!(square_root(0.0) < 1e-18);
        assert_eq!(settled(0.0), 0.0);
        assert_eq!(settled(1e4), 1.0);
    }
}
