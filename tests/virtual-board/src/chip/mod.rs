//! The STM32G431 around its processor.

pub mod adc;
pub mod advanced_timer;
#[cfg(test)]
mod bench;
pub mod comparator;
pub mod dac;
pub mod debug;
pub mod dma;
pub mod dmamux;
pub mod exti;
mod filter;
pub mod flash;
pub mod gpio;
pub mod opamp;
pub mod parts;
pub mod pwr;
pub mod rcc;
pub mod syscfg;
pub mod timer;
mod timer_registers;
pub mod usart;
pub mod watchdog;

use crate::time::{Cycles, NEVER};

/// A register that the chip has and this crate does not model, or an access that it does not model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unmodelled;

/// What one part of the chip tells the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Signal {
    /// An interrupt line, by its position in the vector table, goes up or down.
    Interrupt(u16, bool),
    /// The non-maskable interrupt's line goes up or down.
    NonMaskable(bool),
    /// A DMA request, by its number at the multiplexer (RM0440, table 91).
    Request(u8),
    /// TIM1's trigger output rose.
    Trigger,
    /// A leg's gates.
    Gates {
        /// From 0.
        leg: usize,
        /// The high side's.
        high: bool,
        /// The low side's.
        low: bool,
    },
    /// A converter's sampling ends: it needs the voltage at this channel.
    Sample {
        /// 1 or 2.
        converter: u8,
        /// Its channel.
        channel: u8,
    },
    /// A pin is driven to this level, or released.
    Pin {
        /// Port 0 is A.
        port: u8,
        /// From 0.
        pin: u8,
        /// The level.
        level: Option<bool>,
    },
    /// A serial line has sent a byte.
    Sent {
        /// 1 or 2.
        usart: u8,
        /// The byte.
        byte: u8,
    },
    /// A part is reset: the bus and bit of its reset register, as in [`rcc`].
    ResetPart(u32, u8),
    /// The chip resets itself.
    Reset(Cause),
}

/// Why the chip was reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Power-up.
    Power,
    /// The program.
    Software,
    /// The independent watchdog.
    Watchdog,
    /// The reset pin.
    Pin,
}

/// What a part may use of the rest of the chip.
pub struct Context<'a> {
    /// The time.
    pub now: Cycles,
    /// Its signals to the others, in order.
    pub signals: &'a mut Vec<Signal>,
}

/// A part of the chip with registers. Offsets are in bytes from its first one, and multiples of 4; narrower
/// accesses come as words.
pub trait Part {
    /// Reads a register.
    fn read(&mut self, offset: u32, context: &mut Context) -> Result<u32, Unmodelled>;
    /// Writes a register.
    fn write(&mut self, offset: u32, value: u32, context: &mut Context) -> Result<(), Unmodelled>;
    /// Returns when it next does something by itself.
    fn due(&self) -> Cycles {
        NEVER
    }
    /// Does what is due.
    fn act(&mut self, context: &mut Context) {
        let _ = context;
    }
}

/// The flash that holds code: all but the store.
pub const CODE: std::ops::Range<u32> = 0x0800_0000..0x0801_f000;

/// The flash's last two pages, which hold the parameters.
pub const STORE: std::ops::Range<u32> = 0x0801_f000..0x0802_0000;

/// The chip's unique id (RM0440, 48.1).
pub const UNIQUE_ID: std::ops::Range<u32> = 0x1fff_7590..0x1fff_759c;
