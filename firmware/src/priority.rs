//! Interrupt priorities, and critical sections that respect them.
//!
//! A critical section raises BASEPRI to [`TASKS`]: it masks every interrupt that may use one, and never the PWM
//! interrupt or the gate driver's alarm, whatever a driver or a log does. Those two use none themselves. The
//! default implementation would mask them for as long as a flash erase takes.

use core::arch::asm;

use critical_section::{Impl, RawRestoreState, set_impl};

/// The PWM interrupt, alone at its level.
pub(crate) const PWM: u8 = 0;

/// The gate driver's alarm, on boards that have one.
#[cfg(feature = "stm32f405")]
pub(crate) const ALARM: u8 = 1;

/// Every other interrupt, of the 16 levels of these chips.
pub(crate) const TASKS: u8 = 2;

/// Converts a level to the priority registers' format, which uses the upper bits.
pub(crate) const fn bits(level: u8) -> u8 {
    level << 4
}

struct Basepri;

set_impl!(Basepri);

// SAFETY: everything that uses a critical section runs in thread mode or at `TASKS`, which the raised BASEPRI
// masks; restoring the old value lets sections nest. There is one core.
unsafe impl Impl for Basepri {
    // Never inlined: some sixty sections start with it.
    #[inline(never)]
    unsafe fn acquire() -> RawRestoreState {
        let before: u32;
        // SAFETY: the two registers hold no memory; the ISB makes the new level effective for the next
        // instruction, and without `nomem` the compiler moves no access out of the section.
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
        // SAFETY: as above; restores the value that `acquire` read.
        unsafe {
            asm!(
                "msr BASEPRI, {before}",
                before = in(reg) before,
                options(nostack, preserves_flags),
            );
        }
    }
}

/// Sets every interrupt to [`TASKS`], before a board uses any; start-up then raises two of them. embassy leaves
/// those it enables, the clock's and the DMA's, at 0; setting every line also covers later ones.
pub(crate) fn lower_all(lines: usize) {
    for line in 0..lines {
        set(line, TASKS);
    }
}

/// Sets an interrupt's priority.
pub(crate) fn set(line: usize, level: u8) {
    // SAFETY: one byte of the NVIC's priorities, of which the architecture has 240; what runs at levels above
    // `TASKS` uses no critical section.
    unsafe { (*cortex_m::peripheral::NVIC::PTR).ipr[line].write(bits(level)) }
}
