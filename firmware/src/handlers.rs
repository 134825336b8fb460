//! The final handlers: panic, hard fault, unexpected interrupt.

use core::arch::{asm, naked_asm};
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use siskin_firmware::last_words::{DETAILS, Failure, fail, turn_off};
use siskin_firmware::storage::take_torn_word;

/// Records only addresses: the image has no panic texts.
#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    turn_off();
    fail(Failure::Panic, return_addresses())
}

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
}

/// Returns the return addresses of the innermost calls. On this target every function keeps a frame pointer in
/// r7 to two words: its caller's r7, and its own return address.
#[inline(always)] // it reads its caller's frame
fn return_addresses() -> [u32; DETAILS] {
    let stack = &raw const _stack_end as u32..&raw const _stack_start as u32 - 4;
    let mut frame: u32;
    // SAFETY: reads a register.
    unsafe { asm!("mov {}, r7", out(reg) frame, options(nomem, nostack, preserves_flags)) };
    let mut addresses = [0; DETAILS];
    for address in &mut addresses {
        if !stack.contains(&frame) || !frame.is_multiple_of(4) {
            break;
        }
        // SAFETY: two words of the stack, whatever their contents.
        let words = unsafe { (frame as *const [u32; 2]).read_volatile() };
        [frame, *address] = words;
    }
    addresses
}

/// Hard-fault vector: the stack may be the cause, so it starts a new one.
///
/// # Safety
/// Only the processor may call it.
#[unsafe(naked)]
#[unsafe(export_name = "HardFault")]
#[unsafe(link_section = ".control")]
unsafe extern "C" fn hard_fault_vector() {
    naked_asm!(
        "mrs r0, msp",
        "ldr r1, =_stack_start",
        "msr msp, r1",
        "b {}",
        sym hard_fault,
    )
}

/// Handles a hard fault; `stack` is its stack pointer, of no use if the stack has left its memory.
extern "C" fn hard_fault(stack: u32) -> ! {
    // First of all: the rest reads memory that may be corrupt.
    turn_off();
    let [lowest, highest] = [&raw const _stack_end as u32, &raw const _stack_start as u32];
    // SAFETY: a core register without side effects.
    let status = unsafe { (*SCB::PTR).cfsr.read() };
    // An exception frame is eight words; the seventh is the program counter.
    if stack < lowest {
        fail(Failure::StackOverflow, [0, status, 0, 0])
    } else if !stack.is_multiple_of(4) || stack > highest - 32 {
        fail(Failure::HardFault, [0, status, 0, 0])
    } else {
        // SAFETY: the processor stored the frame there, within the stack.
        let at = unsafe { *((stack + 24) as *const u32) };
        fail(Failure::HardFault, [at, status, 0, 0])
    }
}

/// The exception's number.
const NON_MASKABLE: i32 = -14;

// SAFETY: returns only if a word of the store was read, whose content is not trusted.
#[exception]
unsafe fn NonMaskableInt() {
    if !take_torn_word() {
        fail(Failure::UnexpectedInterrupt, [NON_MASKABLE as u32, 0, 0, 0]);
    }
}

// SAFETY: runs instead of whatever failed and does not return to it.
#[exception]
unsafe fn DefaultHandler(interrupt: i16) -> ! {
    fail(
        Failure::UnexpectedInterrupt,
        [i32::from(interrupt) as u32, 0, 0, 0],
    )
}
