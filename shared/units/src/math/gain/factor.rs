//! The factor of a gain, in the form each machine multiplies by: both give the same bits.
//!
//! Both are `mantissa·2^shift/2^32` with a shift of at most 30. The product with the mantissa keeps
//! its top half, so the shifted result ends in `shift` zeros.

#[cfg(target_pointer_width = "64")]
pub(super) use Long as Factor;
#[cfg(not(target_pointer_width = "64"))]
pub(super) use Short as Factor;

/// For 32-bit registers: an SMMUL and two shifts on a Cortex-M4.
#[cfg(any(test, not(target_pointer_width = "64")))]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Short {
    mantissa: i32,
    shift: u32,
}

#[cfg(any(test, not(target_pointer_width = "64")))]
impl Short {
    pub(super) const fn new(mantissa: i32, shift: u32) -> Self {
        Self { mantissa, shift }
    }

    /// Returns the product, wrapped.
    #[inline(always)] // in each period
    pub(super) fn wrapping(self, x: i32) -> i32 {
        // The mask tells the compiler that the shift is in range.
        self.top(x) << (self.shift & 31)
    }

    /// Returns the product, saturated.
    #[inline(always)] // in each period
    pub(super) fn saturating(self, x: i32) -> i32 {
        let top = self.top(x);
        let shift = self.shift & 31;
        let product = top << shift;
        if product >> shift == top {
            product
        } else {
            beyond(top, shift)
        }
    }

    #[inline(always)] // in each period
    fn top(self, x: i32) -> i32 {
        ((i64::from(self.mantissa) * i64::from(x)) >> 32) as i32
    }
}

/// For 64-bit registers: one product, and a mask for the bits that the other form drops.
#[cfg(target_pointer_width = "64")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Long {
    whole: i64,
    mask: i32,
}

#[cfg(target_pointer_width = "64")]
impl Long {
    pub(super) const fn new(mantissa: i32, shift: u32) -> Self {
        Self {
            whole: (mantissa as i64) << shift,
            mask: -1 << shift,
        }
    }

    /// Returns the product, wrapped.
    #[inline(always)] // in each period
    pub(super) fn wrapping(self, x: i32) -> i32 {
        self.left(self.whole.wrapping_mul(i64::from(x)))
    }

    /// Returns the product, saturated: it overflows 64 bits where the other form overflows 32.
    #[inline(always)] // in each period
    pub(super) fn saturating(self, x: i32) -> i32 {
        match self.whole.checked_mul(i64::from(x)) {
            Some(product) => self.left(product),
            None => end(x.is_negative() != self.whole.is_negative(), self.mask),
        }
    }

    #[inline(always)] // in each period
    fn left(self, product: i64) -> i32 {
        (product >> 32) as i32 & self.mask
    }
}

/// Returns the last product on the side of `top`. Out of line: inlined, it would be computed for
/// every product.
#[cfg(any(test, not(target_pointer_width = "64")))]
#[cold]
#[inline(never)]
fn beyond(top: i32, shift: u32) -> i32 {
    end(top.is_negative(), -1 << (shift & 31))
}

/// Returns the last product on one side of zero.
#[inline(always)] // in each period
fn end(negative: bool, mask: i32) -> i32 {
    if negative { i32::MIN } else { i32::MAX & mask }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn both_forms_make_the_same_bits(
            x: i32,
            mantissa: i32,
            shift in 0_u32..31,
            smaller in 0..31,
        ) {
            let mantissa = mantissa >> smaller;
            let (short, long) = (Short::new(mantissa, shift), Long::new(mantissa, shift));
            prop_assert_eq!(short.wrapping(x), long.wrapping(x));
            prop_assert_eq!(short.saturating(x), long.saturating(x));
        }
    }

    #[test]
    fn both_forms_end_at_the_same_place() {
        for (mantissa, shift) in [(i32::MAX, 30), (1 << 30, 2), (-(1 << 30), 2)] {
            let (short, long) = (Short::new(mantissa, shift), Long::new(mantissa, shift));
            for x in [i32::MIN, -(1 << 30) - 1, -1, 0, 1, (1 << 30) - 1, i32::MAX] {
                assert_eq!(
                    short.saturating(x),
                    long.saturating(x),
                    "{mantissa}·2^{shift}·{x}"
                );
            }
        }
    }
}
