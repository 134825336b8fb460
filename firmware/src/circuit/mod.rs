//! The worth of a count on each board: its circuit from shunts, terminals and supply to the converter.
//!
//! Plain numbers, which a PC needs as well to replay what the chip has done.

pub mod b_g431b_esc1;
pub mod vesc4_f405;
