//! Counts instructions with the system timer.
//!
//! With `-icount shift=10`, QEMU lets each instruction take 2^10 ns; the board's timer runs at 25 MHz: 25.6
//! ticks per instruction, so every count is exact.

use core::hint::black_box;
use core::sync::atomic::{Ordering, compiler_fence};

use cortex_m::asm::nop;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;

/// The timer's 24 bits.
const TOP: u32 = 0x00ff_ffff;

/// Ticks in five instructions.
const TICKS_OF_FIVE: u32 = 128;

/// The running timer.
pub(crate) struct Counter {
    /// Instructions between two readings with nothing in between.
    idle: u32,
}

impl Counter {
    /// Starts the timer.
    pub(crate) fn new(mut timer: SYST) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(TOP);
        timer.clear_current();
        timer.enable_counter();
        let mut counter = Self { idle: 0 };
        // The first reading after the start may still be zero.
        counter.count(|| ());
        counter.idle = counter.count(|| ()).1;
        let (_, four) = counter.count(|| {
            nop();
            nop();
            nop();
            nop();
        });
        assert!(four == 4, "an instruction takes another time");
        counter
    }

    /// Runs `work`, at most 600 000 instructions, and returns how many there were.
    #[inline(always)]
    pub(crate) fn count<T>(&self, work: impl FnOnce() -> T) -> (T, u32) {
        let before = SYST::get_current();
        compiler_fence(Ordering::SeqCst);
        let done = work();
        compiler_fence(Ordering::SeqCst);
        let ticks = before.wrapping_sub(SYST::get_current()) & TOP;
        let instructions = (ticks * 5 + TICKS_OF_FIVE / 2) / TICKS_OF_FIVE;
        // Computed here, not while something else is being counted.
        (done, black_box(instructions - self.idle))
    }
}
