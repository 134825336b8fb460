//! Priorities, and critical sections that respect them.
//!
//! A critical section raises BASEPRI to [`TASKS`]: it holds up every interrupt that may use one,
//! and never the PWM interrupt nor the gate driver's alarm, whatever a driver or a log does. Those
//! two use none themselves. The usual implementation would mask them for as long as an erase of the
//! flash takes.

use core::arch::asm;

use critical_section::{Impl, RawRestoreState, set_impl};

/// Priority of the PWM interrupt, alone there.
pub(crate) const PWM: u8 = 0;

/// Priority of the gate driver's alarm, if the board has one.
#[cfg(feature = "stm32f405")]
pub(crate) const ALARM: u8 = 1;

/// Priority of every other interrupt, of the 16 levels of these chips.
pub(crate) const TASKS: u8 = 2;

/// A level's value in the priority registers, which count from their upper bits.
pub(crate) const fn bits(level: u8) -> u8 {
    level << 4
}

struct Basepri;

set_impl!(Basepri);

// SAFETY: everything that uses a critical section runs in thread mode or at `TASKS`, which the
// raised BASEPRI holds up; restoring the old value lets sections nest. There is one core.
unsafe impl Impl for Basepri {
    // Never inlined: some sixty sections begin with it.
    #[inline(never)]
    unsafe fn acquire() -> RawRestoreState {
        let before: u32;
        // SAFETY: the two registers hold no memory; the instruction synchronisation makes the new
        // level good for the next instruction, and without `nomem` the compiler moves no access out
        // of the section.
        unsafe {
            asm!(
                "mrs {before}, BASEPRI",
                "msr BASEPRI_MAX, {level}",
                "isb",
                before = out(reg) before,
                level = in(reg) u32::from(bits(TASKS)),
                options(nostack, preserves_flags),
            );
        }
        before
    }

    unsafe fn release(before: RawRestoreState) {
        // SAFETY: as above; it is what `acquire` has found.
        unsafe {
            asm!(
                "msr BASEPRI, {before}",
                before = in(reg) before,
                options(nostack, preserves_flags),
            );
        }
    }
}

/// Puts every interrupt at [`TASKS`], as a board does before it uses any; the start gives two of them
/// more. embassy
/// leaves those that it enables, the clock's and the DMA's, at 0; later ones are covered too, since
/// every line is.
pub(crate) fn lower_all(lines: usize) {
    for line in 0..lines {
        set(line, TASKS);
    }
}

/// Sets an interrupt's priority.
pub(crate) fn set(line: usize, level: u8) {
    // SAFETY: one byte of the NVIC's priorities, of which the architecture has 240; what runs at
    // the levels above `TASKS` uses no critical section.
    unsafe { (*cortex_m::peripheral::NVIC::PTR).ipr[line].write(bits(level)) }
}
