//! Saturating sums.

use super::Number;

/// Saturating sum and difference: `saturating_add` and `saturating_sub` in fewer letters, and on a
/// PC in fewer cycles.
///
/// A Cortex-M4 has an instruction for each. A PC has none: what the compiler emits instead adds two
/// cycles to each link of a chain of sums, whereas a branch not taken adds none.
pub trait Held {
    /// self + rhs.
    #[must_use]
    fn plus(self, rhs: Self) -> Self;

    /// self − rhs.
    #[must_use]
    fn minus(self, rhs: Self) -> Self;
}

impl<T: Number> Held for T {
    fn plus(self, rhs: Self) -> Self {
        let (a, b) = (self.to_bits(), rhs.to_bits());
        Self::from_bits(if cfg!(target_arch = "arm") {
            a.saturating_add(b)
        } else {
            a.checked_add(b).unwrap_or_else(|| end(a))
        })
    }

    fn minus(self, rhs: Self) -> Self {
        let (a, b) = (self.to_bits(), rhs.to_bits());
        Self::from_bits(if cfg!(target_arch = "arm") {
            a.saturating_sub(b)
        } else {
            a.checked_sub(b).unwrap_or_else(|| end(a))
        })
    }
}

/// Returns the end of the type on the side of `a`.
fn end(a: i32) -> i32 {
    if a.is_negative() { i32::MIN } else { i32::MAX }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fixed::types::I4F28;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sums_are_those_of_the_standard_library(a: i32, b: i32) {
            let (x, y) = (I4F28::from_bits(a), I4F28::from_bits(b));
            prop_assert_eq!(x.plus(y), x.saturating_add(y));
            prop_assert_eq!(x.minus(y), x.saturating_sub(y));
        }
    }

    #[test]
    fn the_ends_hold() {
        let least = I4F28::DELTA;
        assert_eq!(I4F28::MAX.plus(least), I4F28::MAX);
        assert_eq!(I4F28::MIN.minus(least), I4F28::MIN);
        assert_eq!(I4F28::ZERO.minus(I4F28::MIN), I4F28::MAX);
        assert_eq!(I4F28::MIN.plus(I4F28::MIN), I4F28::MIN);
    }
}
