//! What ends everything: a panic, a hard fault, an unexpected interrupt, an overrun. The bridge is
//! turned off first; then the cause is written to [`RECORD`] for a debugger, and the processor
//! waits for a reset.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m_rt::{ExceptionFrame, exception};

use crate::pwm;

/// Why the processor stopped.
#[derive(Clone, Copy)]
#[repr(u32)]
pub(crate) enum Failure {
    /// A panic: address of the file's name (UTF-8, without an end mark) and line.
    Panic = 1,
    /// A hard fault: program counter and link register.
    HardFault = 2,
    /// An interrupt without a handler: its number, negative for an exception, and 0.
    UnexpectedInterrupt = 3,
    /// A control period was not done with when the next sample came: 0 and 0.
    Overrun = 4,
}

/// [`Failure`] and its two details; all 0 while nothing has happened. Nothing on the chip reads it,
/// and `used` keeps the compiler from leaving it out for that.
#[used]
static RECORD: [AtomicU32; 3] = [const { AtomicU32::new(0) }; 3];

/// Turns the bridge off, writes the cause down and waits for a reset.
pub(crate) fn fail(failure: Failure, detail: u32, more: u32) -> ! {
    // One instruction, and the control interrupt cannot turn the bridge on again.
    cortex_m::interrupt::disable();
    pwm::turn_off();
    for (word, value) in RECORD.iter().zip([failure as u32, detail, more]) {
        word.store(value, Ordering::Relaxed);
    }
    loop {
        cortex_m::asm::wfi();
    }
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    let (file, line) = info
        .location()
        .map_or((0, 0), |at| (at.file().as_ptr() as u32, at.line()));
    fail(Failure::Panic, file, line)
}

// SAFETY: it runs instead of whatever failed and does not return to it; it touches one register of
// the timer and atomics.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    fail(Failure::HardFault, frame.pc(), frame.lr())
}

// SAFETY: as above.
#[exception]
unsafe fn DefaultHandler(interrupt: i16) -> ! {
    fail(Failure::UnexpectedInterrupt, i32::from(interrupt) as u32, 0)
}
