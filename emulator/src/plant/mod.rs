//! Everything outside the chip: motor, inverter, load, supply, sensors.
//!
//! Double precision, `libm`'s functions and a fixed order of operations: equal inputs give equal
//! bits on every machine.
//!
//! # Inlining
//! Without the attributes marked `// in each period`, here and in [`surroundings`](crate::surroundings), the averaged
//! plant runs 24 % slower in `siskin-emulator bench`, and the switching plant 8 %; without those of `surroundings` alone
//! 8 % and 4 %, of `sensing` alone 7 % and 5 %.

mod air;
mod breaks;
mod bus;
mod circuit;
mod conduction;
mod extras;
mod gates;
mod inverter;
mod load;
mod machine;
mod magnetics;
mod motor;
mod noise;
mod rail;
mod sensing;
mod series;
mod shaft;
mod stage;
mod supply;
mod thermal;
mod timing;
mod vector;
mod wires;

pub use air::Air;
pub use breaks::{Breaks, LegBreaks};
pub use bus::Bus;
pub use extras::{Cogging, Drag, Extras, Harmonic, Winding};
pub use gates::{Gate, Gates};
pub use inverter::{Fidelity, Plant};
pub use load::Load;
pub use machine::{Flow, RUNAWAY_RAD_S};
pub use motor::Motor;
pub use noise::{Noise, share_of};
pub use rail::Rail;
pub use sensing::{Sensing, Truth};
pub use stage::DIODE_V;
pub use supply::{CAPACITANCE_F, CAPACITY_C, CELL_OHM, Source, Supply};
pub use thermal::{BOARD_K_PER_W, Thermal};

#[cfg(test)]
mod tests;
