//! DBGMCU: what stops with the processor when a debugger halts it.

use stm32_metapac::dbgmcu::regs::{Apb2fzr, Cr};

use super::{Context, Part, Unmodelled};

/// The part.
#[derive(Debug)]
pub struct Debug {
    control: Cr,
    stopped_apb2: Apb2fzr,
}

impl Debug {
    /// Creates it as after power-up: other resets leave it (RM0440, DBGMCU_CR).
    pub fn new() -> Self {
        Self {
            control: Cr(0),
            stopped_apb2: Apb2fzr(0),
        }
    }
}

impl Debug {
    /// Returns whether TIM1 stops with the processor, and turns its outputs off (RM0440, TIM1's debug
    /// mode).
    pub fn stops_tim1(&self) -> bool {
        self.stopped_apb2.tim1()
    }
}

impl Default for Debug {
    fn default() -> Self {
        Self::new()
    }
}

impl Part for Debug {
    fn read(&mut self, offset: u32, _: &mut Context) -> Result<u32, Unmodelled> {
        match offset {
            0x04 => Ok(self.control.0),
            0x10 => Ok(self.stopped_apb2.0),
            _ => Err(Unmodelled),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _: &mut Context) -> Result<(), Unmodelled> {
        match offset {
            0x04 => self.control = Cr(value),
            0x10 => self.stopped_apb2 = Apb2fzr(value),
            _ => return Err(Unmodelled),
        }
        Ok(())
    }
}
