//! 64-bit division.

/// Returns the low 32 bits of [`divide`].
pub fn quotient(numerator: u64, divisor: u32) -> u32 {
    divide(numerator, divisor) as u32
}

/// Returns `numerator / divisor`; the divisor must not be 0.
///
/// A Cortex-M4 divides 32 bits. The compiler's 64-bit routine takes 1 KB; this is Knuth's algorithm D (The Art of
/// Computer Programming 2, 4.3.1) with two digits of 16 bits: some 60 instructions.
#[inline(never)] // many call it
pub fn divide(numerator: u64, divisor: u32) -> u64 {
    let high = (numerator >> 32) as u32;
    let rest = high % divisor;
    // With the divisor's top bit set, an estimate is at most two too large.
    let shift = divisor.leading_zeros();
    let divisor_shifted = divisor << shift;
    // By words: the chip has no shift of 64 bits. What is left is below the divisor, and loses no bit.
    let low = numerator as u32;
    let rest = rest << shift | low >> 1 >> (31 - shift);
    let low = low << shift;
    let (first, rest) = digit(rest, low >> 16, divisor_shifted);
    let (second, _) = digit(rest, low & 0xffff, divisor_shifted);
    u64::from(high / divisor) << 32 | u64::from(first << 16 | second)
}

/// Divides `rest` and 16 further bits, `next`, by a divisor with its top bit set, which is above `rest`. Returns the digit
/// and what is left.
#[inline(always)] // twice
fn digit(rest: u32, next: u32, divisor: u32) -> (u32, u32) {
    let (upper, lower) = (divisor >> 16, divisor & 0xffff);
    let mut digit = rest / upper;
    let mut left = rest % upper;
    while digit >> 16 != 0 || digit * lower > (left << 16 | next) {
        digit -= 1;
        left += upper;
        if left >> 16 != 0 {
            break;
        }
    }
    let left = (rest << 16 | next).wrapping_sub(digit.wrapping_mul(divisor));
    (digit, left)
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
