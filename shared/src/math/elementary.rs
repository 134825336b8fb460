//! The functions of coefficients that single precision has no instruction for, or that the compiler
//! does not use: each in a tenth of what libm's take of the chip's flash, within a few bits of theirs.

/// √3, which the standard library has not.
pub const SQRT_3: f32 = 1.732_050_8;

/// √x of a number above 0, within 2^-22 of its value.
#[inline(never)] // many call it
pub fn square_root(x: f32) -> f32 {
    // Half the exponent, and a straight line between powers of two: right to 4 %. Newton's rule
    // squares that.
    let mut root = f32::from_bits((x.to_bits() >> 1) + 0x1fbd_1df5);
    for _ in 0..3 {
        root = 0.5 * (root + x / root);
    }
    root
}

/// 1 − e^(−x) of a number from 0 to 10 000, within 2^-20 of its value: the share of its way that a
/// filter goes in x time constants.
#[inline(never)] // many call it
pub fn settled(x: f32) -> f32 {
    // In a thousandth of the time it is nearly a straight line; after twice a time, the same share of
    // what is left has been gone once more.
    let part = x / 1024.0;
    let mut share = part / (1.0 + 0.5 * part);
    for _ in 0..10 {
        share *= 2.0 - share;
    }
    share
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

    #[test]
    fn ends() {
        assert_eq!(SQRT_3, libm::sqrtf(3.0));
        assert!(square_root(0.0) < 1e-18);
        assert_eq!(settled(0.0), 0.0);
        assert_eq!(settled(1e4), 1.0);
    }
}
