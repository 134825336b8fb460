//! Flash as on the STM32G4, and its contents after a power failure.

use core::ops::Range;
use std::vec;
use std::vec::Vec;

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use super::random::Random;

pub(super) const PAGE: usize = 2048;
pub(super) const WORD: usize = 8;
/// One page, as on the first board.
pub(super) const HALF: usize = PAGE;
pub(super) const RANGE: Range<u32> = 0..2 * HALF as u32;

/// Pages of 2 KB, words of 8 bytes, each written once after an erase.
#[derive(Clone)]
pub(super) struct RamFlash {
    pub(super) bytes: Vec<u8>,
    pub(super) erases: usize,
    pub(super) reads: usize,
    /// Reads until it refuses them.
    pub(super) reads_left: usize,
    /// Words and pages until power fails, within the next one.
    pub(super) steps_left: usize,
    /// Decides what remains after a power failure.
    pub(super) chance: Random,
}

#[derive(Debug)]
pub(super) struct Refused;

impl NorFlashError for Refused {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for RamFlash {
    type Error = Refused;
}

impl RamFlash {
    pub(super) fn new() -> Self {
        Self::holding(vec![0xff; RANGE.end as usize])
    }

    pub(super) fn holding(bytes: Vec<u8>) -> Self {
        Self {
            bytes,
            erases: 0,
            reads: 0,
            reads_left: usize::MAX,
            steps_left: usize::MAX,
            chance: Random::new(0),
        }
    }

    /// Returns true if the next step completes; an error after the power has failed.
    fn step(&mut self) -> Result<bool, Refused> {
        match self.steps_left {
            // It has already failed.
            0 => Err(Refused),
            1 => {
                self.steps_left = 0;
                Ok(false)
            }
            _ => {
                self.steps_left -= 1;
                Ok(true)
            }
        }
    }
}

impl ReadNorFlash for RamFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Refused> {
        self.reads += 1;
        self.reads_left = self.reads_left.checked_sub(1).ok_or(Refused)?;
        let offset = offset as usize;
        bytes.copy_from_slice(&self.bytes[offset..offset + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl NorFlash for RamFlash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Refused> {
        assert!((from as usize).is_multiple_of(PAGE) && (to as usize).is_multiple_of(PAGE));
        for from in (from as usize..to as usize).step_by(PAGE) {
            let whole = self.step()?;
            let chance = &mut self.chance;
            let page = &mut self.bytes[from..from + PAGE];
            if whole {
                page.fill(0xff);
                self.erases += 1;
                continue;
            }
            // An erase first writes zeros, then sets all bits; each may be partial.
            match chance.below(4) {
                0 => {}
                1 => page.iter_mut().for_each(|byte| *byte &= chance.byte()),
                2 => page.iter_mut().for_each(|byte| *byte |= chance.byte()),
                _ => page.iter_mut().for_each(|byte| *byte = chance.byte()),
            }
            return Err(Refused);
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Refused> {
        assert!((offset as usize).is_multiple_of(WORD) && bytes.len().is_multiple_of(WORD));
        for (i, word) in bytes.chunks_exact(WORD).enumerate() {
            let at = offset as usize + i * WORD;
            if self.bytes[at..at + WORD].iter().any(|byte| *byte != 0xff) {
                return Err(Refused);
            }
            let whole = self.step()?;
            for (place, byte) in self.bytes[at..at + WORD].iter_mut().zip(word) {
                // A bit to be cleared has been, or has not.
                *place = if whole {
                    *byte
                } else {
                    *byte | self.chance.byte()
                };
            }
            if !whole {
                return Err(Refused);
            }
        }
        Ok(())
    }
}
