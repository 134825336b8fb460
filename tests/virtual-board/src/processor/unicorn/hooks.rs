//! The engine's callbacks: at the start of a block, for its exceptions, and for registers.

use std::ops::Range;

use unicorn_engine::{RegisterARM, Unicorn};

use super::registers::{read, write};
use super::{Inside, Running, Sleep};
use crate::processor::exceptions::{self, State};
use crate::processor::priority::{Masks, bit, number};
use crate::processor::{BusError, Stop, Surroundings, Width};
use crate::time::Cycles;

/// The processor's own registers; the debug unit's after them are the chip's.
const PRIVATE: Range<u32> = 0xe000_0000..0xe004_0000;

/// Flash, which stalls fetches while it is being written.
const FLASH: Range<u32> = 0x0800_0000..0x0802_0000;

/// The engine's names for its interrupts (QEMU, target/arm/cpu.h).
const SV_CALL: u32 = 2;
const BREAKPOINT: u32 = 7;
const EXCEPTION_EXIT: u32 = 8;

const WFE: u16 = 0xbf20;
const YIELD: u16 = 0xbf10;

/// The IT state in xPSR.
const WITHIN_IT: u32 = 0x0600_fc00;

/// Bits of CFSR and HFSR: an undefined instruction, a precise and an imprecise bus error, a stacking error;
/// a fault escalated to a hard one.
pub(super) const UNDEFINED: u32 = 1 << 16;
pub(super) const PRECISE: u32 = 1 << 9;
pub(super) const ADDRESS_VALID: u32 = 1 << 15;
const IMPRECISE: u32 = 1 << 10;
pub(super) const FETCH: u32 = 1 << 8;
pub(super) const STACKING: u32 = 1 << 12;
pub(super) const FORCED: u32 = 1 << 30;

/// Handles the start of a code block.
pub(super) fn block<S: Surroundings + 'static>(
    engine: &mut Unicorn<'_, Inside<S>>,
    address: u64,
    bytes: u32,
) {
    let address = address as u32;
    let inside = engine.get_data_mut();
    inside.settle();
    // Before anything that also stops it, or it would be lost.
    if inside.private.reset_requested && inside.stop.is_none() {
        inside.private.reset_requested = false;
        inside.stop = Some(Stop::Reset);
    }
    if inside.surroundings.asks_to_stop() {
        inside.stop.get_or_insert(Stop::Asked);
    }
    if inside.stop.is_some() {
        let _ = engine.emu_stop();
        return;
    }
    if FLASH.contains(&address) {
        let until = inside.surroundings.flash_busy_until();
        while inside.surroundings.now() < until {
            inside.wait(until);
        }
    }
    inside.latch();
    if inside.private.exceptions.any() {
        let masks = engine.masks();
        if let Some(exception) = engine.exceptions().due(masks) {
            return exceptions::enter(engine, exception, address);
        }
    }
    let inside = engine.get_data_mut();
    let prefetches = inside.surroundings.flash_prefetches();
    let memories = &inside.memories;
    let (number, cycles) = inside.costs.enter(address, bytes, prefetches, || {
        let mut memories = memories.iter();
        let mapped = memories.find(|mapped| mapped.memory.holds(address, bytes));
        mapped.map_or_else(Vec::new, |mapped| {
            mapped.memory.bytes(address, bytes as usize)
        })
    });
    inside.began = inside.surroundings.now();
    inside.running = Some(Running {
        address,
        number,
        cycles: cycles.into(),
        spent: 0,
    });
}

/// Handles an exception that the engine reports.
pub(super) fn interrupt<S: Surroundings + 'static>(engine: &mut Unicorn<'_, Inside<S>>, kind: u32) {
    engine.get_data_mut().settle();
    let pc = read(engine, RegisterARM::PC);
    match kind {
        EXCEPTION_EXIT => exceptions::leave(engine, pc),
        SV_CALL => synchronous(engine, number::SV_CALL, pc),
        BREAKPOINT => fault(engine, number::HARD_FAULT, 0, pc),
        _ => fault(engine, number::USAGE_FAULT, UNDEFINED, pc),
    }
}

/// Handles an instruction that the engine rejects.
pub(super) fn invalid<S: Surroundings + 'static>(engine: &mut Unicorn<'_, Inside<S>>) -> bool {
    let pc = read(engine, RegisterARM::PC) & !1;
    let inside = engine.get_data_mut();
    inside.settle();
    let before = inside.memory(pc.wrapping_sub(2), 2);
    let code = before.map_or(0, |mapped| mapped.memory.read(pc.wrapping_sub(2), 2)) as u16;
    match code {
        WFE => {
            if !std::mem::take(&mut inside.event) {
                inside.asleep = Some(Sleep::Event);
                doze(engine);
            }
        }
        YIELD => {}
        _ => fault(engine, number::USAGE_FAULT, UNDEFINED, pc),
    }
    true
}

/// Lets time pass until the processor wakes, or the run is to stop.
pub(super) fn doze<S: Surroundings + 'static>(engine: &mut Unicorn<'_, Inside<S>>) {
    let masks = engine.masks();
    while let Some(sleep) = engine.get_data().asleep {
        let inside = engine.get_data_mut();
        inside.latch();
        // An interrupt masked by PRIMASK alone ends WFI, but not WFE.
        let masks = match sleep {
            Sleep::Interrupt => Masks {
                primask: false,
                ..masks
            },
            Sleep::Event => masks,
        };
        let pends = inside.private.sleep & 0x10 != 0 && inside.private.exceptions.pending != 0;
        if inside.private.exceptions.due(masks).is_some() || (pends && sleep == Sleep::Event) {
            inside.asleep = None;
        } else if inside.surroundings.asks_to_stop() {
            inside.stop.get_or_insert(Stop::Asked);
            let _ = engine.emu_stop();
            return;
        } else {
            inside.wait(Cycles::MAX);
        }
    }
}

/// Takes an exception caused by the instruction itself.
fn synchronous<S: Surroundings + 'static>(
    engine: &mut Unicorn<'_, Inside<S>>,
    exception: u16,
    pc: u32,
) {
    let masks = engine.masks();
    let exceptions = engine.exceptions();
    let now = exceptions.execution_priority(masks);
    let taken = exceptions.enabled & bit(exception) != 0 && exceptions.priority(exception) < now;
    if taken {
        exceptions::enter(engine, exception, pc);
    } else if now > -1 {
        engine.get_data_mut().private.hfsr |= FORCED;
        exceptions::enter(engine, number::HARD_FAULT, pc);
    } else {
        engine.get_data_mut().stop = Some(Stop::LockedUp);
        let _ = engine.emu_stop();
    }
}

/// The same for a fault, with its cause.
pub(super) fn fault<S: Surroundings + 'static>(
    engine: &mut Unicorn<'_, Inside<S>>,
    exception: u16,
    cause: u32,
    pc: u32,
) {
    engine.get_data_mut().private.cfsr |= cause;
    synchronous(engine, exception, pc);
}

/// Advances to the time of the instruction that accesses a register, and returns its address.
fn reach<S: Surroundings + 'static>(engine: &mut Unicorn<'_, Inside<S>>) -> u32 {
    let pc = read(engine, RegisterARM::PC) & !1;
    engine.get_data_mut().reach(pc);
    // With the program counter the engine restores the access's IT state, and keeps it: the next block
    // would be executed under its condition.
    let xpsr = read(engine, RegisterARM::XPSR);
    if xpsr & WITHIN_IT != 0 {
        write(engine, RegisterARM::XPSR, xpsr & !WITHIN_IT);
    }
    pc
}

fn width(bytes: usize) -> Width {
    match bytes {
        1 => Width::Byte,
        2 => Width::Half,
        _ => Width::Word,
    }
}

pub(super) fn load<S: Surroundings + 'static>(
    engine: &mut Unicorn<'_, Inside<S>>,
    address: u32,
    bytes: usize,
) -> u64 {
    let pc = reach(engine);
    let Inside {
        surroundings,
        private,
        ..
    } = engine.get_data_mut();
    let result = if PRIVATE.contains(&address) {
        private.exceptions.latch(surroundings.lines());
        private.read(address, width(bytes), surroundings.now())
    } else {
        surroundings.read(address, width(bytes))
    };
    match result {
        Ok(value) => value.into(),
        Err(error) => {
            refused(engine, error, address, pc, None);
            0
        }
    }
}

pub(super) fn store<S: Surroundings + 'static>(
    engine: &mut Unicorn<'_, Inside<S>>,
    address: u32,
    bytes: usize,
    value: u32,
) {
    let pc = reach(engine);
    let Inside {
        surroundings,
        private,
        ..
    } = engine.get_data_mut();
    let result = if PRIVATE.contains(&address) {
        private.exceptions.latch(surroundings.lines());
        private.write(address, width(bytes), value, surroundings.now())
    } else {
        surroundings.write(address, width(bytes), value)
    };
    if let Err(error) = result {
        refused(engine, error, address, pc, Some(value));
    }
}

/// Handles a failed access: by a bus fault after the instruction, or by ending the run.
fn refused<S: Surroundings + 'static>(
    engine: &mut Unicorn<'_, Inside<S>>,
    error: BusError,
    address: u32,
    pc: u32,
    written: Option<u32>,
) {
    let inside = engine.get_data_mut();
    match error {
        BusError::Nothing => {
            inside.private.cfsr |= IMPRECISE;
            inside.private.fault_address = address;
            let exceptions = &mut inside.private.exceptions;
            let enabled = exceptions.enabled & bit(number::BUS_FAULT) != 0;
            let exception = if enabled {
                number::BUS_FAULT
            } else {
                inside.private.hfsr |= FORCED;
                number::HARD_FAULT
            };
            exceptions.pending |= bit(exception);
        }
        BusError::Unmodelled => {
            inside.stop = Some(Stop::Unmodelled {
                address,
                pc,
                written,
            });
            let _ = engine.emu_stop();
        }
    }
}
