//! A throttle as a share of its range.

/// A share of the throttle's range, 0 to 1; its highest value, 1 − 2⁻³¹, stands for 1.
///
/// 0 is the least throttle that turns, and not a stop: whether to turn is separate. A throttle
/// for the other direction is the complement of its share, −2⁻³¹ to −1: see [`reverse`].
pub type Share = fixed::types::I1F31;

/// The throttle of the same share in the other direction, `!share`: the least one has one too.
pub const fn reverse(throttle: Share) -> Share {
    Share::from_bits(!throttle.to_bits())
}
