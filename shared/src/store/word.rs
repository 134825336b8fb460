//! The words of a set, and its seal.

use embedded_storage::nor_flash::NorFlash;
use siskin_params::checksum::checksum;

use super::error::StoreError;

/// Keys of words that are not values; [`kept`](super::kept) has those of values.
pub(super) mod key {
    /// The seal that ends a set.
    pub(in crate::store) const SEAL: u16 = 0;
    /// The schema, a set's first word.
    pub(in crate::store) const SCHEMA: u16 = 0x1000;
}

/// The unit of flash reads and writes.
pub(super) struct Word {
    pub(super) key: u16,
    /// Number of its set.
    pub(super) number: u16,
    /// A value's bits, or the set's checksum.
    pub(super) bits: u32,
}

impl Word {
    pub(super) const BYTES: u32 = 8;

    pub(super) fn read<F: NorFlash>(flash: &mut F, at: u32) -> Result<Self, StoreError> {
        let mut bytes = [0; Self::BYTES as usize];
        flash.read(at, &mut bytes).map_err(|_| StoreError::Flash)?;
        let [a, b, c, d, e, f, g, h] = bytes;
        Ok(Self {
            key: u16::from_le_bytes([a, b]),
            number: u16::from_le_bytes([c, d]),
            bits: u32::from_le_bytes([e, f, g, h]),
        })
    }

    fn bytes(&self) -> [u8; Self::BYTES as usize] {
        let [a, b] = self.key.to_le_bytes();
        let [c, d] = self.number.to_le_bytes();
        let [e, f, g, h] = self.bits.to_le_bytes();
        [a, b, c, d, e, f, g, h]
    }

    /// Returns true for erased flash.
    pub(super) fn is_blank(&self) -> bool {
        self.bytes() == [0xFF; Self::BYTES as usize]
    }
}

/// CRC-32 over the words of a set. It always detects one, two or three wrong bits in a set and any single wrong
/// byte; of all other errors it misses one in 2^32.
#[derive(Clone, Copy)]
pub(super) struct Check(pub(super) u32);

impl Check {
    /// Initial value, over no words.
    pub(super) const ORIGIN: Self = Self(!0);

    /// Returns the checksum extended by one word.
    pub(super) fn over(self, word: &Word) -> Self {
        Self(checksum(self.0, &word.bytes()))
    }
}

/// Writes a set word by word.
pub(super) struct Writer {
    pub(super) at: u32,
    pub(super) number: u16,
    check: Check,
}

impl Writer {
    pub(super) fn new(at: u32, number: u16) -> Self {
        Self {
            at,
            number,
            check: Check::ORIGIN,
        }
    }

    pub(super) fn put<F: NorFlash>(
        &mut self,
        flash: &mut F,
        key: u16,
        bits: u32,
    ) -> Result<(), StoreError> {
        const { assert!((Word::BYTES as usize).is_multiple_of(F::WRITE_SIZE)) }
        let word = Word {
            key,
            number: self.number,
            bits,
        };
        flash
            .write(self.at, &word.bytes())
            .map_err(|_| StoreError::Flash)?;
        self.check = self.check.over(&word);
        self.at += Word::BYTES;
        Ok(())
    }

    pub(super) fn seal<F: NorFlash>(&mut self, flash: &mut F) -> Result<(), StoreError> {
        self.put(flash, key::SEAL, self.check.0)
    }
}
