//! What is outside the chip: motor, inverter, load, supply, sensors.
//!
//! Double precision, `libm`'s functions and a fixed order of operations: equal inputs give equal
//! bits on every machine.

mod circuit;
mod inverter;
mod load;
mod machine;
mod motor;
mod noise;
mod sensing;
mod series;
mod stage;
mod supply;
mod thermal;
mod vector;

pub use inverter::{Fidelity, Plant};
pub use load::Load;
pub use machine::Flow;
pub use motor::Motor;
pub use noise::Noise;
pub use sensing::{Sensing, Truth};
pub use stage::DIODE_V;
pub use supply::Supply;
pub use thermal::Thermal;

#[cfg(test)]
mod tests;
