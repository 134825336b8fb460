//! Exception entry and return (ARMv7-M, B1.5.6 to B1.5.8).
//!
//! The floating-point state is stored at once, while the processor would only reserve its space and store
//! it when the handler uses the unit: a program cannot tell the difference.

use super::Register::{Control, Lr, Msp, Pc, Psp, R, Sp, Xpsr};
use super::priority::{Exceptions, Masks, number};
use super::{Register, cost};

/// CONTROL bits: the process stack, and floating-point state to be saved.
const SPSEL: u32 = 2;
const FPCA: u32 = 4;

/// xPSR bits: the exception's number, Thumb, and that the stack was realigned.
const NUMBER: u32 = 0x1ff;
const THUMB: u32 = 1 << 24;
const PADDED: u32 = 1 << 9;
/// The flags N, Z, C, V, Q and the four GE.
const FLAGS: u32 = 0xf80f_0000;
/// What is restored from a stacked xPSR: flags, IT and T.
const RESTORED: u32 = 0xff0f_fc00 & !PADDED;

/// EXC_RETURN, with the bits for a frame without floating point, thread mode and the process stack.
const EXC_RETURN: u32 = 0xffff_ffe1;
const BASIC: u32 = 0x10;
const THREAD: u32 = 8;
const PROCESS: u32 = 4;

/// Words in a frame: without and with floating point.
const BASIC_WORDS: u32 = 8;
const FLOAT_WORDS: u32 = 26;

/// The registers that a frame begins with; the return address and xPSR follow.
const STACKED: [Register; 6] = [R(0), R(1), R(2), R(3), R(12), Lr];

/// What exceptions need from a processor.
pub(super) trait State {
    fn get(&self, register: Register) -> u32;
    fn set(&mut self, register: Register, value: u32);
    /// s0 to s15, and FPSCR as the 17th.
    fn float(&self, index: u32) -> u32;
    fn set_float(&mut self, index: u32, value: u32);
    /// Reads a word of plain memory.
    fn load(&self, address: u32) -> Option<u32>;
    /// Writes one; returns false if there is none.
    fn store(&mut self, address: u32, value: u32) -> bool;
    fn exceptions(&mut self) -> &mut Exceptions;
    fn vector_table(&self) -> u32;
    /// Clears FAULTMASK, as the return from any exception except the NMI does.
    fn clear_faultmask(&mut self);
    fn masks(&self) -> Masks;
    /// Notes that an exception's handler begins, or has ended.
    fn note(&mut self, exception: u16, entered: bool);
    /// Spends the time that this takes.
    fn spend(&mut self, cycles: u64);
    /// Returns the hard fault that follows when the stack is not in memory.
    fn stacking_fault(&mut self) -> u16;
}

/// Takes an exception at an instruction boundary: the program continues at `return_address` afterwards.
pub(super) fn enter(state: &mut impl State, exception: u16, return_address: u32) {
    let control = state.get(Control);
    let xpsr = state.get(Xpsr);
    let float = control & FPCA != 0;
    let thread = xpsr & NUMBER == 0;
    let process = thread && control & SPSEL != 0;
    let words = if float { FLOAT_WORDS } else { BASIC_WORDS };
    let unaligned = state.get(Sp).wrapping_sub(4 * words);
    let frame = unaligned & !7;
    let padded = if unaligned & 4 == 0 { 0 } else { PADDED };

    let mut stored = true;
    for (index, register) in (0..).zip(STACKED) {
        let value = state.get(register);
        stored &= state.store(frame.wrapping_add(4 * index), value);
    }
    stored &= state.store(frame.wrapping_add(24), return_address & !1);
    stored &= state.store(frame.wrapping_add(28), xpsr & !PADDED | padded);
    if float {
        for index in 0..17 {
            let value = state.float(index);
            stored &= state.store(frame.wrapping_add(32 + 4 * index), value);
        }
    }
    state.set(Sp, frame);

    let bit = |is: bool, bit| if is { bit } else { 0 };
    let exc_return = EXC_RETURN | bit(!float, BASIC) | bit(thread, THREAD) | bit(process, PROCESS);
    let exception = if stored {
        exception
    } else {
        state.stacking_fault()
    };
    state.spend(cost::ENTRY);
    begin(state, exception, exc_return);
    // After the change to handler mode, where a different stack does not matter.
    state.set(Control, control & !FPCA);
}

/// Returns from the current exception, by the value loaded into the program counter; or continues with the
/// next one due.
pub(super) fn leave(state: &mut impl State, exc_return: u32) {
    let exc_return = exc_return | 1;
    let exception = (state.get(Xpsr) & NUMBER) as u16;
    state.note(exception, false);
    state.exceptions().leave(exception);
    if exception != number::NMI {
        state.clear_faultmask();
    }
    let masks = state.masks();
    if let Some(next) = state.exceptions().due(masks) {
        state.spend(cost::TAIL_CHAIN);
        return begin(state, next, exc_return);
    }

    let stack = if exc_return & PROCESS == 0 { Msp } else { Psp };
    let frame = state.get(stack);
    let word = |state: &mut _, index: u32| load(state, frame.wrapping_add(4 * index));
    for (index, register) in (0..).zip(STACKED) {
        let value = word(state, index);
        state.set(register, value);
    }
    let pc = word(state, 6);
    let xpsr = word(state, 7);
    let float = exc_return & BASIC == 0;
    if float {
        for index in 0..17 {
            let value = word(state, 8 + index);
            state.set_float(index, value);
        }
    }
    let words = if float { FLOAT_WORDS } else { BASIC_WORDS };
    let padding = if xpsr & PADDED == 0 { 0 } else { 4 };
    let above = frame.wrapping_add(4 * words + padding);
    state.set(stack, above);
    state.spend(cost::RETURN);
    let number = if exc_return & THREAD == 0 {
        xpsr & NUMBER
    } else {
        0
    };
    state.set(Xpsr, xpsr & RESTORED | number);
    let mut control = state.get(Control) & !(FPCA | SPSEL);
    if float {
        control |= FPCA;
    }
    if exc_return & PROCESS != 0 {
        control |= SPSEL;
    }
    state.set(Control, control);
    state.set(Pc, pc | 1);
}

/// Begins a handler.
fn begin(state: &mut impl State, exception: u16, exc_return: u32) {
    state.exceptions().enter(exception);
    let flags = state.get(Xpsr) & FLAGS;
    state.set(Xpsr, flags | THUMB | u32::from(exception));
    state.set(Lr, exc_return);
    let vector = state.vector_table() + 4 * u32::from(exception);
    let handler = load(state, vector);
    state.note(exception, true);
    state.set(Pc, handler | 1);
}

/// Reads a word that must exist: a vector, or part of a stored frame.
fn load(state: &mut impl State, address: u32) -> u32 {
    state.load(address).unwrap_or(0)
}
