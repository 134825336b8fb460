//! The part of the flash that keeps the parameters.
//!
//! The HAL's driver waits in code that itself lies in flash, which stalls the processor with all its
//! interrupts. This one waits in RAM, so the control interrupt keeps running; all others are masked meanwhile,
//! since their code is in flash.

use core::ops::Range;
use core::sync::atomic::{AtomicBool, Ordering, compiler_fence};

use embassy_stm32::Peri;
use embassy_stm32::peripherals::FLASH;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read,
    check_write,
};

use crate::chip::flash::{self, PAGE_BYTES, WORD_BYTES};
use crate::chip::pages;

/// The store is being read.
static READING: AtomicBool = AtomicBool::new(false);

/// Cycles after a read within which the flash reports a torn word: several times its bus delay.
const READ_TOLD_CYCLES: u32 = 32;

/// Returns the address range of the store, from the linker script.
fn place() -> Range<usize> {
    unsafe extern "C" {
        static __store: u8;
        static __store_end: u8;
    }
    (&raw const __store as usize)..(&raw const __store_end as usize)
}

/// Returns the whole store, as offsets from its start.
pub(crate) fn range() -> Range<u32> {
    0..place().len() as u32
}

/// Returns true if a non-maskable interrupt is for a word of the store that a loss of power has torn: any torn
/// word that the flash reports while the store is read. The reader carries on: that word's set has no seal, or
/// a wrong one.
pub fn take_torn_word() -> bool {
    pages::take_torn_word() && READING.load(Ordering::Relaxed)
}

/// The store's flash; offsets are from its start.
pub struct Storage {
    _flash: Peri<'static, FLASH>,
    place: Range<usize>,
}

/// Why the flash failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StorageError {
    /// Outside the store, or not aligned to words or pages.
    Misplaced(NorFlashErrorKind),
    /// The flash reported an error.
    Failed,
}

impl NorFlashError for StorageError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Misplaced(kind) => *kind,
            Self::Failed => NorFlashErrorKind::Other,
        }
    }
}

impl Storage {
    /// Creates the store of this chip; nothing else may write to it.
    pub fn new(flash: Peri<'static, FLASH>) -> Self {
        Self {
            _flash: flash,
            place: place(),
        }
    }
}

impl ErrorType for Storage {
    type Error = StorageError;
}

impl ReadNorFlash for Storage {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), StorageError> {
        check_read(self, offset, bytes.len()).map_err(StorageError::Misplaced)?;
        let from = (self.place.start + offset as usize) as *const u8;
        READING.store(true, Ordering::Relaxed);
        compiler_fence(Ordering::SeqCst);
        // SAFETY: within the store, which is memory-mapped; its words change only in `write` and `erase`, which
        // also borrow this.
        unsafe { from.copy_to_nonoverlapping(bytes.as_mut_ptr(), bytes.len()) };
        // The last word's interrupt may come some cycles after the word.
        cortex_m::asm::delay(READ_TOLD_CYCLES);
        READING.store(false, Ordering::Relaxed);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.place.len()
    }
}

impl NorFlash for Storage {
    const WRITE_SIZE: usize = WORD_BYTES;
    const ERASE_SIZE: usize = PAGE_BYTES;

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), StorageError> {
        check_write(self, offset, bytes.len()).map_err(StorageError::Misplaced)?;
        let mut address = self.place.start + offset as usize;
        for word in bytes.as_chunks::<WORD_BYTES>().0 {
            // SAFETY: within the store.
            unsafe { flash::program(address, word) }.map_err(|_| StorageError::Failed)?;
            address += WORD_BYTES;
        }
        Ok(())
    }

    fn erase(&mut self, from: u32, to: u32) -> Result<(), StorageError> {
        check_erase(self, from, to).map_err(StorageError::Misplaced)?;
        for offset in (from as usize..to as usize).step_by(PAGE_BYTES) {
            // SAFETY: within the store.
            unsafe { flash::erase(self.place.start + offset) }.map_err(|_| StorageError::Failed)?;
        }
        Ok(())
    }
}
