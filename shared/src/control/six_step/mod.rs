//! Six-step drive by zero crossings: section III.B of the first paper, its baseline for comparison.
//!
//! In each sixth of an electrical turn, a sextant, one leg switches, one is held low and the third
//! floats. The floating phase shows its back-EMF, whose zero crossing mid-sextant gives the rotor's
//! position. Nothing here knows the motor's resistance, inductance or flux.

pub mod commutation;
pub mod crossing;
pub mod duty;
pub mod tracking;
