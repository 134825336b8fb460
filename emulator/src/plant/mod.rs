//! What is outside the chip: motor, inverter, load, supply, sensors.
//!
//! Double precision, `libm`'s functions and a fixed order of operations: equal inputs give equal
//! bits on every machine.

mod averaged;
mod load;
mod motor;
mod noise;
mod sensing;
mod supply;
mod thermal;

pub use averaged::{Averaged, Drive, Flow, inverter};
pub use load::Load;
pub use motor::Motor;
pub use noise::Noise;
pub use sensing::Sensing;
pub use supply::Supply;
pub use thermal::Thermal;
