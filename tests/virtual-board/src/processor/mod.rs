//! The Cortex-M4F that executes the image, and its surroundings.
//!
//! [`Processor`] translates the code with QEMU's engine; exceptions, the interrupt controller, SysTick and
//! the cycle counter are this crate's (`exceptions`, `private`). It runs in its [`Surroundings`].
//!
//! # What code costs
//! Instructions cost what the processor's manual says (DDI 0439, 3.3.1); where that gives a range, the
//! figures below apply. Flash adds four wait states per double word that is not in the caches (32 lines of
//! four double words for code, 8 for constants), fewer with the prefetch.
//!
//! | | cycles |
//! |---|---|
//! | most instructions, and a store through the write buffer | 1 |
//! | a load | 2 |
//! | several registers, or a double word | 1, plus 1 each |
//! | a branch that ends a block, taken or not | 1, plus 2 to refill the pipeline |
//! | a division | 7, from a range of 2 to 12 |
//! | a floating-point division or root; multiply-add | 14; 3 |
//! | a barrier, to or from a special register | 2 |
//! | code in SRAM: per word over the system bus | 1 more |
//! | code in CCM | 0 more |
//! | entry into a handler, return, tail-chaining | 12, 10, 6 |
//!
//! An instruction whose condition fails counts as executed. Not counted: bus contention with the DMA, and
//! constants read from flash other than PC-relative.

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

/// Width of an access in bytes.
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
    /// Returns it as a number.
    pub fn bytes(self) -> u32 {
        match self {
            Self::Byte => 1,
            Self::Half => 2,
            Self::Word => 4,
        }
    }
}

/// How an instruction accesses memory.
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
    /// The chip has it, but it is not modelled, or not like this: the run ends and says where.
    Unmodelled,
}

/// Interrupt lines from the chip to the processor: they stay up as long as their cause lasts.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    /// One bit per interrupt, by its position in the vector table.
    pub interrupts: u128,
    /// The non-maskable interrupt.
    pub non_maskable: bool,
    /// Lines that have risen since the processor last looked: some are down again, their cause removed by
    /// the DMA, but their interrupts are pending all the same.
    risen: Cell<u128>,
}

impl Lines {
    /// Raises or lowers an interrupt's line.
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

    /// Returns those that have risen since the last call.
    pub fn take_risen(&self) -> u128 {
        self.risen.take()
    }
}

/// Why a processor has stopped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The surroundings asked for it.
    Asked,
    /// The program has requested a chip reset.
    Reset,
    /// A fault within a fault: the processor does nothing any more.
    LockedUp,
    /// An access that is not modelled.
    Unmodelled {
        /// The address accessed.
        address: u32,
        /// The instruction's address.
        pc: u32,
        /// What was written, if it was a write.
        written: Option<u32>,
    },
    /// An instruction that the engine does not know.
    Undefined {
        /// Its address.
        pc: u32,
    },
}

/// What a processor runs in: registers, time, interrupt lines. Plain memory is the engine's.
pub trait Surroundings {
    /// Returns the time.
    fn now(&self) -> Cycles;
    /// Reads outside plain memory.
    fn read(&mut self, address: u32, width: Width) -> Result<u32, BusError>;
    /// Writes outside plain memory.
    fn write(&mut self, address: u32, width: Width, value: u32) -> Result<(), BusError>;
    /// Advances by the time that the processor has spent.
    fn pass(&mut self, cycles: Cycles);
    /// Returns when something may next happen by itself.
    fn next(&self) -> Cycles;
    /// Returns the current lines.
    fn lines(&self) -> &Lines;
    /// Returns whether the processor shall stop before its next instruction.
    fn asks_to_stop(&self) -> bool;
    /// Returns until when code in flash has to wait.
    fn flash_busy_until(&self) -> Cycles;
    /// Returns whether the flash prefetches.
    fn flash_prefetches(&self) -> bool {
        false
    }
    /// Notes that the processor has entered an exception's handler, or returned from it.
    fn exception(&mut self, passage: &HandlerEvent) {
        let _ = passage;
    }
}

/// Entry into a handler, or return from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HandlerEvent {
    /// The exception's number; interrupts are numbered from 16.
    pub exception: u16,
    /// Whether it is an entry.
    pub entered: bool,
    /// Instructions since power-up.
    pub instructions: u64,
    /// Since when the processor could have taken an exception of this priority between two instructions,
    /// though it did so only now: the engine checks at the start of a code block.
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
    /// The return address of a call.
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
