//! Throttle as a share of its range.

/// A share of the throttle range, 0 to 1; the highest value, 1 − 2⁻³¹, stands for 1.
///
/// 0 is the lowest throttle that turns the motor, not a stop, which is separate. Throttle in the other
/// direction is the share's complement, −2⁻³¹ to −1: see [`reverse`].
pub type Share = fixed::types::I1F31;

/// Returns the same share in the other direction, `!share`, so that the lowest one has a reverse too.
pub const fn reverse(throttle: Share) -> Share {
    Share::from_bits(!throttle.to_bits())
}
