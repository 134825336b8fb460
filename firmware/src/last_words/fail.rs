//! Ends a run after a failure, and reports it at the start of the next.

use core::cell::UnsafeCell;

use cortex_m::peripheral::SCB;
use heapless::String;

use super::record::{DETAILS, Failure, Record, TEXT_BYTES};
use crate::chip::bridge;

struct Place(UnsafeCell<Record>);

// SAFETY: written by `fail`, which nothing interrupts and which does not return, and by `take`, which runs
// before anything could fail in an interrupt.
unsafe impl Sync for Place {}

/// The linker script puts it where start-up clears nothing.
#[unsafe(link_section = ".last_words")]
static PLACE: Place = Place(UnsafeCell::new(Record::empty()));

/// Turns the bridge off for good: nothing that could turn it on runs again.
pub fn turn_off() {
    // One instruction, after which the control interrupt cannot turn the bridge on again.
    cortex_m::interrupt::disable();
    bridge::turn_off(bridge::TIMER);
}

/// Turns the bridge off, records the cause, and resets the chip.
#[cold]
pub fn fail(failure: Failure, details: [u32; DETAILS]) -> ! {
    turn_off();
    let record = Record::new(failure, details);
    // SAFETY: nothing interrupts this or comes after it.
    unsafe { PLACE.0.get().write_volatile(record) };
    SCB::sys_reset()
}

/// Turns the bridge off and resets the chip, at the user's request.
pub fn restart() -> ! {
    turn_off();
    SCB::sys_reset()
}

/// Returns why the previous run ended, unless by power-down or on request, and clears the record; `starved` tells
/// that its watchdog was not fed. Call it once, early.
pub fn take(starved: bool) -> Option<String<TEXT_BYTES>> {
    // SAFETY: a failure in between writes the whole record and does not return.
    let record = unsafe { PLACE.0.get().read_volatile() };
    // SAFETY: as above.
    unsafe { PLACE.0.get().write_volatile(Record::empty()) };
    let text = record.text();
    let text = text
        .or_else(|| starved.then(|| String::try_from("Restart: the watchdog was not fed").ok())?);
    #[cfg(feature = "defmt")]
    defmt::info!("last words: {}", text.as_deref());
    text
}
