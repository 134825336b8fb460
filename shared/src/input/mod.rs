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
/// 0 is the least throttle that turns, and not a stop: whether to turn is said beside it.
pub type Throttle = fixed::types::I1F31;
