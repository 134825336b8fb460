//! The Cortex-M4F: what executes the image, and what it stands in.
//!
//! [`Processor`] translates the code by QEMU's engine; exceptions, the interrupt controller, SysTick and
//! the cycle counter are this crate's (`exceptions`, `private`). It stands in its [`Surroundings`].
//!
//! # What code costs
//! Instructions by the table of the processor's manual (DDI 0439, 3.3.1), where it gives a range by the
//! figures below. What is in flash waits for it: four wait states a double word that is not in the caches
//! (32 lines of four double words for code, 8 for constants), less with the prefetch.
//!
//! | | cycles |
//! |---|---|
//! | most instructions, and a store by the write buffer | 1 |
//! | a load | 2 |
//! | several registers, or a double word | 1 and 1 each |
//! | a branch that ends a block, taken or not | 1, and 2 to refill the pipeline |
//! | a division | 7, of 2 to 12 |
//! | a floating-point division or root; multiply and add | 14; 3 |
//! | a barrier, to or from a special register | 2 |
//! | code in SRAM: a word over the system bus | 1 more |
//! | code in CCM | 0 more |
//! | entry into a handler, return, from one to the next | 12, 10, 6 |
//!
//! An instruction whose condition does not hold counts as one that is executed. Not counted: contention
//! for the bus with the DMA, constants from flash by another way than by the program counter.

mod cost;
mod counters;
mod exceptions;
mod flash_cache;
mod priority;
mod private;
#[cfg(test)]
mod selftest;
mod unicorn;

pub use cost::ENTRY;
pub use unicorn::Processor;

use std::cell::Cell;

use crate::memory::Memory;
use crate::time::Cycles;

/// Bytes of an access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// One.
    Byte,
    /// Two.
    Half,
    /// Four.
    Word,
}

impl Width {
    /// As a number.
    pub fn bytes(self) -> u32 {
        match self {
            Self::Byte => 1,
            Self::Half => 2,
            Self::Word => 4,
        }
    }
}

/// What an instruction does with a memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// It reads.
    Read,
    /// It writes.
    Write,
}

/// Why an access outside plain memory fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusError {
    /// Nothing is there: the processor takes a bus fault.
    Nothing,
    /// The chip has it, but it is not modelled, or not so: the run ends and says where.
    Unmodelled,
}

/// Interrupt lines from the chip to the processor: they stay up for as long as their cause does.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    /// A bit an interrupt, by its position in the vector table.
    pub interrupts: u128,
    /// The non-maskable interrupt.
    pub non_maskable: bool,
    /// Those that have come up since the processor looked last: some are down again, their cause taken
    /// away by the DMA, and have made their interrupt pending all the same.
    risen: Cell<u128>,
}

impl Lines {
    /// An interrupt's line goes up or down.
    pub fn set(&mut self, position: u16, up: bool) {
        let line = 1 << position;
        if up {
            let risen = line & !self.interrupts;
            self.risen.set(self.risen.get() | risen);
            self.interrupts |= line;
        } else {
            self.interrupts &= !line;
        }
    }

    /// Those that have come up since this was asked last.
    pub fn take_risen(&self) -> u128 {
        self.risen.take()
    }
}

/// Why a processor has stopped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The surroundings asked for it.
    Asked,
    /// The program has asked for a reset of the chip.
    Reset,
    /// A fault within a fault: the processor does nothing any more.
    LockedUp,
    /// An access that is not modelled.
    Unmodelled {
        /// Where to.
        address: u32,
        /// By which instruction.
        pc: u32,
        /// What was written, if it was a write.
        written: Option<u32>,
    },
    /// An instruction that the engine does not know.
    Undefined {
        /// Where it is.
        pc: u32,
    },
}

/// What a processor stands in: registers, time, interrupt lines. Plain memory is the engine's.
pub trait Surroundings {
    /// The time.
    fn now(&self) -> Cycles;
    /// Reads outside plain memory.
    fn read(&mut self, address: u32, width: Width) -> Result<u32, BusError>;
    /// Writes outside plain memory.
    fn write(&mut self, address: u32, width: Width, value: u32) -> Result<(), BusError>;
    /// The processor has spent this time.
    fn pass(&mut self, cycles: Cycles);
    /// The next time at which something may happen by itself.
    fn next(&self) -> Cycles;
    /// The lines, as they are now.
    fn lines(&self) -> &Lines;
    /// Whether the processor shall stop before its next instruction.
    fn asks_to_stop(&self) -> bool;
    /// Until when code that lies in flash has to wait.
    fn flash_busy_until(&self) -> Cycles;
    /// Whether the flash reads ahead.
    fn flash_prefetches(&self) -> bool {
        false
    }
    /// The processor has entered the handler of an exception, or has returned from it.
    fn exception(&mut self, passage: &HandlerEvent) {
        let _ = passage;
    }
}

/// An entry into a handler, or a return from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HandlerEvent {
    /// The exception's number; interrupts are numbered from 16.
    pub exception: u16,
    /// Whether it is entered.
    pub entered: bool,
    /// Instructions since power-up.
    pub instructions: u64,
    /// Since when the processor could have taken an exception of this priority between two instructions,
    /// and did so only now: the engine looks where a block of code begins.
    pub since: Cycles,
}

/// Plain memory as the processor sees it.
#[derive(Clone, Debug)]
pub struct Mapped {
    /// The bytes.
    pub memory: Memory,
    /// Whether the program may write it.
    pub writable: bool,
}

/// The processor's registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Register {
    /// r0 to r12.
    R(u8),
    /// The stack pointer in use.
    Sp,
    /// Where a call returns to.
    Lr,
    /// The next instruction.
    Pc,
    /// Flags, exception number, execution state.
    Xpsr,
    /// The main stack pointer.
    Msp,
    /// The process stack pointer.
    Psp,
    /// PRIMASK.
    Primask,
    /// BASEPRI.
    Basepri,
    /// CONTROL.
    Control,
}
