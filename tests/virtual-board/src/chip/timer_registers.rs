//! Offsets of the timers' registers (RM0440, register maps of TIM1 and of TIM2 to TIM5).

use super::Unmodelled;

pub(super) const CR1: u32 = 0x00;
pub(super) const CR2: u32 = 0x04;
pub(super) const DIER: u32 = 0x0c;
pub(super) const SR: u32 = 0x10;
pub(super) const EGR: u32 = 0x14;
pub(super) const CCMR1: u32 = 0x18;
pub(super) const CCMR2: u32 = 0x1c;
pub(super) const CCER: u32 = 0x20;
pub(super) const CNT: u32 = 0x24;
pub(super) const PSC: u32 = 0x28;
pub(super) const ARR: u32 = 0x2c;
pub(super) const RCR: u32 = 0x30;
pub(super) const CCR1: u32 = 0x34;
pub(super) const CCR4: u32 = 0x40;
pub(super) const BDTR: u32 = 0x44;
pub(super) const AF1: u32 = 0x60;

/// Returns the channel, from 0, of a compare register.
pub(super) fn channel(offset: u32) -> usize {
    ((offset - CCR1) / 4) as usize
}

/// Returns the value, if it has only these bits.
pub(super) fn only(value: u32, bits: u32) -> Result<u32, Unmodelled> {
    if value & !bits == 0 {
        Ok(value)
    } else {
        Err(Unmodelled)
    }
}
