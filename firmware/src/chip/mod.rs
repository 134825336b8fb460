//! Chip support that the HAL lacks, shared by all boards with a chip.

pub(crate) mod bridge;
pub(crate) mod capture;
pub(crate) mod flash;
#[cfg(feature = "stm32f405")]
mod stm32f4;
#[cfg(feature = "stm32g431")]
mod stm32g4;

#[cfg(feature = "stm32f405")]
pub use stm32f4::*;
#[cfg(feature = "stm32g431")]
pub use stm32g4::*;

/// What caused a reset of the chip.
pub(crate) struct Reset {
    /// The supply came, or came back.
    pub(crate) power_up: bool,
    /// The watchdog was not fed.
    pub(crate) starved: bool,
}
