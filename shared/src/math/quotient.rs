//! 64-bit division.

/// Returns the low 32 bits of [`divide`].
pub fn quotient(numerator: u64, divisor: u32) -> u32 {
    divide(numerator, divisor) as u32
}

/// Returns `numerator / divisor`; the divisor must not be 0.
///
/// A Cortex-M4 divides 32 bits. The compiler's 64-bit routine takes 1 KB to be fast; this one takes a tenth of that,
/// and about 300 instructions per quotient.
#[inline(never)] // many call it
pub fn divide(numerator: u64, divisor: u32) -> u64 {
    let high = (numerator >> 32) as u32;
    let mut rest = high % divisor;
    let mut quotient = numerator as u32;
    for _ in 0..u32::BITS {
        // The numerator shifts out of the quotient's word at one end as the quotient shifts in at the other.
        let carry = rest >> 31 != 0;
        rest = rest << 1 | quotient >> 31;
        quotient <<= 1;
        if carry || rest >= divisor {
            rest = rest.wrapping_sub(divisor);
            quotient |= 1;
        }
    }
    u64::from(high / divisor) << 32 | u64::from(quotient)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn quotients_are_those_of_the_language(
            numerator: u64,
            places in 0..64,
            divisor in 1..=u32::MAX,
            smaller in 0..32,
        ) {
            let (numerator, divisor) = (numerator >> places, u32::max(divisor >> smaller, 1));
            prop_assert_eq!(divide(numerator, divisor), numerator / u64::from(divisor));
        }
    }

    #[test]
    fn ends() {
        assert_eq!(divide(u64::MAX, u32::MAX), (1 << 32) + 1);
        assert_eq!(quotient((1 << 32) - 1, 1), u32::MAX);
        assert_eq!(quotient(1 << 32, 1), 0);
        assert_eq!(
            quotient((u64::from(u32::MAX) << 32) - 1, u32::MAX),
            u32::MAX
        );
    }
}
