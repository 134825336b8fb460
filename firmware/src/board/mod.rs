//! The board, selected by a feature: one file per board.
#![doc = include_str!("third.md")]

mod parts;
pub(crate) mod wiring;

#[cfg(feature = "b-g431b-esc1")]
mod b_g431b_esc1;
#[cfg(feature = "vesc4-f405")]
mod vesc4_f405;

#[cfg(feature = "b-g431b-esc1")]
pub use b_g431b_esc1::*;
#[cfg(feature = "vesc4-f405")]
pub use vesc4_f405::*;
