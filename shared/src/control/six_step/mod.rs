//! Six-step drive by zero crossings: section III.B of the first paper, the baseline that it
//! compares with.
//!
//! In each sixth of an electrical turn, a sextant, one leg switches, one is held low and the third
//! floats. The floating phase shows its back-EMF, whose crossing of zero in the sextant's middle
//! tells where the rotor is. Nothing here knows the motor's resistance, inductance or flux.

pub mod commutation;
pub mod crossing;
pub mod duty;
pub mod tracking;
