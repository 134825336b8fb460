//! The processor's own registers, 0xE000_E000 and 0xE000_1000 (ARMv7-M, B3).

use super::BusError;
use super::Width;
use super::counters::{CycleCounter, SysTick};
use super::priority::{Exceptions, bit, number};
use crate::time::Cycles;

/// CPUID: Cortex-M4 r0p1.
const CPUID: u32 = 0x410f_c241;

/// AIRCR's key for writing.
const KEY: u32 = 0x05fa;
/// The same as read back.
const KEY_READ: u32 = 0xfa05;

/// CCR: the stack is aligned to 8 bytes on exceptions.
const STACK_ALIGNED: u32 = 1 << 9;

/// FPCCR after a reset: the floating-point state is saved, lazily.
const FPCCR: u32 = 0xc000_0000;
const FPCCR_LAZY: u32 = 1 << 30;

/// The fault handlers that SHCSR enables, with their bits.
const FAULTS: [(u16, u32); 3] = [
    (number::MEMORY_FAULT, 1 << 16),
    (number::BUS_FAULT, 1 << 17),
    (number::USAGE_FAULT, 1 << 18),
];

/// The registers, with the exception state behind them.
#[derive(Clone, Debug)]
pub(super) struct Private {
    pub(super) exceptions: Exceptions,
    pub(super) sys_tick: SysTick,
    pub(super) cycles: CycleCounter,
    pub(super) vtor: u32,
    /// SCR.
    pub(super) sleep: u32,
    pub(super) cfsr: u32,
    pub(super) hfsr: u32,
    pub(super) fault_address: u32,
    pub(super) reset_requested: bool,
    cpacr: u32,
    demcr: u32,
    fpccr: u32,
}

impl Private {
    pub(super) fn new() -> Self {
        Self {
            exceptions: Exceptions::new(),
            sys_tick: SysTick::default(),
            cycles: CycleCounter::default(),
            vtor: 0,
            sleep: 0,
            cfsr: 0,
            hfsr: 0,
            fault_address: 0,
            reset_requested: false,
            cpacr: 0,
            demcr: 0,
            fpccr: FPCCR,
        }
    }

    /// Reads a register, or part of one.
    pub(super) fn read(
        &mut self,
        address: u32,
        width: Width,
        now: Cycles,
    ) -> Result<u32, BusError> {
        let shift = 8 * (address & 3);
        let word = self.word(address & !3, now)? >> shift;
        Ok(match width {
            Width::Byte => word & 0xff,
            Width::Half => word & 0xffff,
            Width::Word => word,
        })
    }

    fn word(&mut self, address: u32, now: Cycles) -> Result<u32, BusError> {
        let exceptions = &self.exceptions;
        let interrupts = |set: u128, first: u32| (set >> number::INTERRUPTS >> first) as u32;
        let first = (address & 0xf) * 8;
        Ok(match address {
            0xe000_e100..0xe000_e110 | 0xe000_e180..0xe000_e190 => {
                interrupts(exceptions.enabled, first)
            }
            0xe000_e200..0xe000_e210 | 0xe000_e280..0xe000_e290 => {
                interrupts(exceptions.pending, first)
            }
            0xe000_e300..0xe000_e310 => interrupts(exceptions.active, first),
            0xe000_e400..0xe000_e4f0 => self.priorities(address - 0xe000_e400 + 16),
            0xe000_e010 => self.sys_tick.control(now),
            0xe000_e014 => self.sys_tick.reload,
            0xe000_e018 => self.sys_tick.current(now),
            0xe000_e01c => 0xc000_0000,
            0xe000_ed00 => CPUID,
            0xe000_ed04 => self.icsr(),
            0xe000_ed08 => self.vtor,
            0xe000_ed0c => KEY_READ << 16,
            0xe000_ed10 => self.sleep,
            0xe000_ed14 => STACK_ALIGNED,
            0xe000_ed18..0xe000_ed24 => self.priorities(address - 0xe000_ed18 + 4),
            0xe000_ed24 => self.shcsr(),
            0xe000_ed28 => self.cfsr,
            0xe000_ed2c => self.hfsr,
            0xe000_ed34 | 0xe000_ed38 => self.fault_address,
            0xe000_ed88 => self.cpacr,
            0xe000_edfc => self.demcr,
            0xe000_ef34 => self.fpccr,
            0xe000_1000 => self.cycles.control(),
            0xe000_1004 => self.cycles.count(now),
            _ => return Err(BusError::Unmodelled),
        })
    }

    /// Writes a register, or part of one.
    pub(super) fn write(
        &mut self,
        address: u32,
        width: Width,
        value: u32,
        now: Cycles,
    ) -> Result<(), BusError> {
        // Priorities are written in bytes, all else in words.
        let of_priorities =
            |address| matches!(address, 0xe000_e400..0xe000_e4f0 | 0xe000_ed18..0xe000_ed24);
        if of_priorities(address) {
            let exception = match address {
                0xe000_ed18.. => address - 0xe000_ed18 + 4,
                _ => address - 0xe000_e400 + 16,
            };
            for index in 0..width.bytes() {
                let bits = (value >> (8 * index)) as u8;
                let exception = (exception + index) as u16;
                self.exceptions.set_priority_bits(exception, bits);
            }
            return Ok(());
        }
        if width != Width::Word {
            return Err(BusError::Unmodelled);
        }
        let exceptions = &mut self.exceptions;
        let first = (address & 0xf) * 8;
        let interrupts = u128::from(value) << first << number::INTERRUPTS;
        match address {
            0xe000_e100..0xe000_e110 => exceptions.enabled |= interrupts,
            0xe000_e180..0xe000_e190 => exceptions.enabled &= !interrupts,
            0xe000_e200..0xe000_e210 => exceptions.pending |= interrupts,
            0xe000_e280..0xe000_e290 => exceptions.pending &= !interrupts,
            0xe000_ef00 => exceptions.pending |= bit(number::INTERRUPTS + (value & 0x1ff) as u16),
            0xe000_e010 => self.sys_tick.set_control(value, now),
            0xe000_e014 => self.sys_tick.reload = value & 0xff_ffff,
            0xe000_e018 => self.sys_tick.clear(now),
            0xe000_ed04 => self.set_icsr(value),
            0xe000_ed08 => self.vtor = value & !0x7f,
            0xe000_ed0c => return self.set_aircr(value),
            0xe000_ed10 if value & !0x10 == 0 => self.sleep = value,
            0xe000_ed14 if value == STACK_ALIGNED => {}
            0xe000_ed24 => {
                for (exception, enabled) in FAULTS {
                    if value & enabled == 0 {
                        exceptions.enabled &= !bit(exception);
                    } else {
                        exceptions.enabled |= bit(exception);
                    }
                }
            }
            0xe000_ed28 => self.cfsr &= !value,
            0xe000_ed2c => self.hfsr &= !value,
            0xe000_ed88 => self.cpacr = value,
            0xe000_edfc => self.demcr = value,
            // Lazily or at once: a program cannot tell.
            0xe000_ef34 if value & !FPCCR_LAZY == FPCCR & !FPCCR_LAZY => self.fpccr = value,
            0xe000_1000 => self.cycles.set_control(value, now),
            0xe000_1004 => self.cycles.set(value, now),
            _ => return Err(BusError::Unmodelled),
        }
        Ok(())
    }

    /// Returns four priorities, starting with an exception's.
    fn priorities(&self, exception: u32) -> u32 {
        let bits = |index: u32| self.exceptions.priority_bits((exception + index) as u16);
        u32::from_le_bytes([bits(0), bits(1), bits(2), bits(3)])
    }

    fn icsr(&self) -> u32 {
        let exceptions = &self.exceptions;
        let pending = |exception| u32::from(exceptions.pending & bit(exception) != 0);
        let current = u32::from(self.current());
        let next = exceptions.highest().map_or(0, |(exception, _)| exception);
        let alone = exceptions.active.count_ones() <= 1;
        current
            | u32::from(alone) << 11
            | u32::from(next) << 12
            | u32::from(exceptions.pending >> number::INTERRUPTS != 0) << 22
            | pending(number::SYS_TICK) << 26
            | pending(number::PEND_SV) << 28
            | pending(number::NMI) << 31
    }

    /// Returns the exception being handled, or 0.
    fn current(&self) -> u16 {
        let exceptions = &self.exceptions;
        let active = (1..128).filter(|exception| exceptions.active & bit(*exception) != 0);
        let highest = active.min_by_key(|exception| exceptions.priority(*exception));
        highest.unwrap_or(0)
    }

    fn set_icsr(&mut self, value: u32) {
        let pending = &mut self.exceptions.pending;
        for (at, exception) in [
            (31, number::NMI),
            (28, number::PEND_SV),
            (26, number::SYS_TICK),
        ] {
            if value >> at & 1 != 0 {
                *pending |= bit(exception);
            }
        }
        for (at, exception) in [(27, number::PEND_SV), (25, number::SYS_TICK)] {
            if value >> at & 1 != 0 {
                *pending &= !bit(exception);
            }
        }
    }

    /// Writes AIRCR. All four priority bits pre-empt: other groupings are not modelled.
    fn set_aircr(&mut self, value: u32) -> Result<(), BusError> {
        let grouping = value >> 8 & 7;
        if value >> 16 != KEY {
            return Ok(());
        }
        if grouping > 3 {
            return Err(BusError::Unmodelled);
        }
        self.reset_requested |= value & 4 != 0;
        Ok(())
    }

    fn shcsr(&self) -> u32 {
        let exceptions = &self.exceptions;
        let enabled = FAULTS
            .iter()
            .filter(|(exception, _)| exceptions.enabled & bit(*exception) != 0);
        enabled.map(|(_, bits)| bits).sum()
    }
}
