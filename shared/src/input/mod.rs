//! From the edges of the throttle wire to the decision whether the motor may turn.
//!
//! ```text
//! timer edges → capture::Decoder → Event → authority::Authority → Command
//! ```
//!
//! [`dshot`] knows what a frame means, [`capture`] how it looks on a timer, and [`authority`]
//! alone what may turn a motor. None of them has a clock: the caller says when something happened.

pub mod authority;
pub mod capture;
pub mod dshot;

#[cfg(test)]
mod noise;

/// A share of the throttle's range, 0 to 1; its highest value, 1 − 2⁻³¹, stands for 1.
///
/// 0 is the least throttle that turns, and not a stop: whether to turn is said beside it. A throttle
/// for the other direction is the complement of its share, −2⁻³¹ to −1: see [`reverse`].
pub type Throttle = fixed::types::I1F31;

/// The throttle of the same share in the other direction, `!share`: the least one has one too.
pub const fn reverse(throttle: Throttle) -> Throttle {
    Throttle::from_bits(!throttle.to_bits())
}
