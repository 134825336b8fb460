//! The engine's registers by the names used here.

use unicorn_engine::{RegisterARM, Unicorn};

use crate::processor::Register;

/// Reads one of the engine's registers; it has all that are requested here.
pub(super) fn read<D>(engine: &Unicorn<'_, D>, register: RegisterARM) -> u32 {
    read_number(engine, register as i32)
}

pub(super) fn read_number<D>(engine: &Unicorn<'_, D>, register: i32) -> u32 {
    engine.reg_read(register).unwrap_or(0) as u32
}

pub(super) fn write<D>(engine: &mut Unicorn<'_, D>, register: RegisterARM, value: u32) {
    // As above.
    let _ = engine.reg_write(register, value.into());
}

/// Returns s0 to s15 and FPSCR.
pub(super) fn float_name(index: u32) -> i32 {
    match index {
        16 => RegisterARM::FPSCR as i32,
        _ => RegisterARM::S0 as i32 + index as i32,
    }
}

/// Returns the engine's name for a register.
pub(super) fn name(register: Register) -> RegisterARM {
    const GENERAL: [RegisterARM; 13] = [
        RegisterARM::R0,
        RegisterARM::R1,
        RegisterARM::R2,
        RegisterARM::R3,
        RegisterARM::R4,
        RegisterARM::R5,
        RegisterARM::R6,
        RegisterARM::R7,
        RegisterARM::R8,
        RegisterARM::R9,
        RegisterARM::R10,
        RegisterARM::R11,
        RegisterARM::R12,
    ];
    match register {
        Register::R(number) => GENERAL[usize::from(number)],
        Register::Sp => RegisterARM::SP,
        Register::Lr => RegisterARM::LR,
        Register::Pc => RegisterARM::PC,
        Register::Xpsr => RegisterARM::XPSR,
        Register::Msp => RegisterARM::MSP,
        Register::Psp => RegisterARM::PSP,
        Register::Primask => RegisterARM::PRIMASK,
        Register::Basepri => RegisterARM::BASEPRI,
        Register::Control => RegisterARM::CONTROL,
    }
}
