//! Programs and erases flash; these chips differ only in word and page size.

use core::sync::atomic::{AtomicBool, Ordering, compiler_fence};

use embassy_stm32::pac::flash::regs::{Cr, Sr};
use embassy_stm32::pac::iwdg::vals::Key;
use embassy_stm32::pac::{FLASH, IWDG};

pub(crate) use super::pages::{PAGE_BYTES, WORD_BYTES};
use super::pages::{erasing, programming, supply_is_low};

/// Start of the flash.
const ORIGIN: usize = 0x0800_0000;

/// The flash is being written.
static WRITING: AtomicBool = AtomicBool::new(false);

/// Returns true while the flash is being written: the control interrupt, which keeps running, then calls
/// nothing in flash, and the bridge is off.
// Always inlined: an out-of-line function would itself be in flash.
#[inline(always)]
pub(crate) fn is_writing() -> bool {
    WRITING.load(Ordering::Relaxed)
}

/// The flash reported an error.
pub(crate) struct Failed;

/// Programs a word that is blank since the last erase.
///
/// # Safety
/// Nothing but data may be there.
pub(crate) unsafe fn program(address: usize, word: &[u8; WORD_BYTES]) -> Result<(), Failed> {
    with_unlocked(|| {
        FLASH.cr().write_value(programming());
        // SAFETY: by the caller.
        unsafe { write_and_wait(address as *mut u32, word) };
    })
}

/// Erases the page that starts here.
///
/// # Safety
/// Nothing but data may be there.
pub(crate) unsafe fn erase(address: usize) -> Result<(), Failed> {
    // The watchdog's period covers one erase, and several may follow each other.
    IWDG.kr().write(|w| w.set_key(Key::RESET));
    let mut control = erasing((address - ORIGIN) / PAGE_BYTES);
    let done = with_unlocked(|| {
        FLASH.cr().write_value(control);
        control.set_strt(true);
        start_and_wait(control);
    });
    forget_cached();
    done
}

/// Runs `act` with the flash unlocked and no interrupt but the control's, then checks for errors.
fn with_unlocked(act: impl FnOnce()) -> Result<(), Failed> {
    if supply_is_low() {
        return Err(Failed);
    }
    critical_section::with(|_| {
        FLASH.keyr().write_value(0x4567_0123);
        FLASH.keyr().write_value(0xcdef_89ab);
        // Writing 1 clears error flags.
        FLASH.sr().write_value(FLASH.sr().read());
        WRITING.store(true, Ordering::Relaxed);
        // The interrupt must see this before the flash operation starts and until it ends.
        compiler_fence(Ordering::SeqCst);
        act();
        compiler_fence(Ordering::SeqCst);
        WRITING.store(false, Ordering::Relaxed);
        let errors = Sr(FLASH.sr().read().0 & !ended().0);
        FLASH.cr().write(|w| w.set_lock(true));
        if errors.0 == 0 { Ok(()) } else { Err(Failed) }
    })
}

/// Returns the status bits that are not errors.
fn ended() -> Sr {
    let mut flags = Sr(0);
    flags.set_eop(true);
    flags.set_bsy(true);
    flags
}

/// In RAM, since flash stalls whoever fetches from it.
#[inline(never)] // to stay where its section is
#[unsafe(link_section = ".data.flash")]
fn start_and_wait(control: Cr) {
    FLASH.cr().write_value(control);
    while FLASH.sr().read().bsy() {}
}

/// Writes a word and waits, in RAM as above.
///
/// # Safety
/// The word must be in a part of the flash that belongs to no program.
#[inline(never)]
#[unsafe(link_section = ".data.flash")]
unsafe fn write_and_wait(mut address: *mut u32, word: &[u8; WORD_BYTES]) {
    for bytes in word.as_chunks::<4>().0 {
        // SAFETY: by the caller; the address is word-aligned.
        unsafe {
            address.write_volatile(u32::from_le_bytes(*bytes));
            address = address.add(1);
        }
    }
    while FLASH.sr().read().bsy() {}
}

/// Flushes the cache, which may hold what has been erased.
fn forget_cached() {
    FLASH.acr().modify(|w| w.set_dcen(false));
    FLASH.acr().modify(|w| w.set_dcrst(true));
    FLASH.acr().modify(|w| w.set_dcrst(false));
    FLASH.acr().modify(|w| w.set_dcen(true));
}
