//! Programming and erasing the flash, alike on these chips but for their words and pages.

use core::sync::atomic::{AtomicBool, Ordering, compiler_fence};

use embassy_stm32::pac::flash::regs::{Cr, Sr};
use embassy_stm32::pac::iwdg::vals::Key;
use embassy_stm32::pac::{FLASH, IWDG};

pub(crate) use super::pages::{PAGE_BYTES, WORD_BYTES};
use super::pages::{erasing, programming};

/// The beginning of the flash.
const ORIGIN: usize = 0x0800_0000;

/// True while the flash is being written.
static WRITING: AtomicBool = AtomicBool::new(false);

/// Returns true while the flash is being written: the control's interrupt, which goes on, then calls
/// nothing that lies there, and the bridge is off.
// Always inlined: as a function it would lie in the flash itself.
#[inline(always)]
pub(crate) fn is_writing() -> bool {
    WRITING.load(Ordering::Relaxed)
}

/// The flash has reported an error.
pub(crate) struct Failed;

/// Programs a word that has been blank since the last erase.
///
/// # Safety
/// Nothing but data lies there.
pub(crate) unsafe fn program(address: usize, word: &[u8; WORD_BYTES]) -> Result<(), Failed> {
    with_unlocked(|| {
        FLASH.cr().write_value(programming());
        // SAFETY: by the caller.
        unsafe { write_and_wait(address as *mut u32, word) };
    })
}

/// Erases the page that begins here.
///
/// # Safety
/// Nothing but data lies there.
pub(crate) unsafe fn erase(address: usize) -> Result<(), Failed> {
    // One erase is as long as the watchdog waits, and several may follow each other.
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

/// Does something with the flash unlocked, and no interrupt but the control's; then looks whether
/// it went well.
fn with_unlocked(act: impl FnOnce()) -> Result<(), Failed> {
    critical_section::with(|_| {
        FLASH.keyr().write_value(0x4567_0123);
        FLASH.keyr().write_value(0xcdef_89ab);
        // Flags of errors are removed by ones.
        FLASH.sr().write_value(FLASH.sr().read());
        WRITING.store(true, Ordering::Relaxed);
        // The interrupt must know before the flash begins, and until it has ended.
        compiler_fence(Ordering::SeqCst);
        act();
        compiler_fence(Ordering::SeqCst);
        WRITING.store(false, Ordering::Relaxed);
        let errors = Sr(FLASH.sr().read().0 & !ended().0);
        FLASH.cr().write(|w| w.set_lock(true));
        if errors.0 == 0 { Ok(()) } else { Err(Failed) }
    })
}

/// The status that is no error.
fn ended() -> Sr {
    let mut flags = Sr(0);
    flags.set_eop(true);
    flags.set_bsy(true);
    flags
}

/// The flash stalls who fetches from it: this is in RAM.
#[inline(never)] // to stay where its section is
#[unsafe(link_section = ".data.flash")]
fn start_and_wait(control: Cr) {
    FLASH.cr().write_value(control);
    while FLASH.sr().read().bsy() {}
}

/// As above.
///
/// # Safety
/// The word is in a part of the flash that is no program's.
#[inline(never)]
#[unsafe(link_section = ".data.flash")]
unsafe fn write_and_wait(mut address: *mut u32, word: &[u8; WORD_BYTES]) {
    for bytes in word.as_chunks::<4>().0 {
        // SAFETY: by the caller; the address is a multiple of a word's bytes.
        unsafe {
            address.write_volatile(u32::from_le_bytes(*bytes));
            address = address.add(1);
        }
    }
    while FLASH.sr().read().bsy() {}
}

/// The cache may hold what has been erased.
fn forget_cached() {
    FLASH.acr().modify(|w| w.set_dcen(false));
    FLASH.acr().modify(|w| w.set_dcrst(true));
    FLASH.acr().modify(|w| w.set_dcrst(false));
    FLASH.acr().modify(|w| w.set_dcen(true));
}
