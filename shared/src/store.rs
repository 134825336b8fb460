//! Parameters in flash.
//!
//! A save appends all stored values as one set, of 8 bytes a value, and ends it with a seal over them.
//! The newest set with its seal counts, so a loss of power leaves the values of this save or of the one
//! before. The flash is used in two halves: where one has no more room, or anything written is not
//! whole, the other is erased for the set. What it replaces stays until the new one stands.

use core::ops::Range;

use embedded_storage::nor_flash::NorFlash;

use crate::params::{Kind, ParamId, Params, TABLE};

/// Key of the seal; no parameter has it.
const SEAL: u16 = 0;
/// Number of the first set in empty flash.
const FIRST: u16 = 1;

/// How sound the stored parameters were.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrity {
    /// Every value is the one that was saved.
    Sound,
    /// Nothing was stored: the values are the defaults.
    Empty,
    /// A save was interrupted, or a value has rotted: the values are those of an earlier save, or the
    /// defaults if there is none.
    Incomplete,
    /// No order was found in the flash: the values are the defaults.
    Corrupt,
    /// The flash could not be read: the values are the defaults.
    Unreadable,
}

/// Why nothing is promised of what was stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The range is not two halves of whole pages of the flash.
    BadRange,
    /// The flash refused a read, a write or an erase.
    Flash,
    /// The parameters do not fit, or the flash does not hold what was written to it.
    NotStored,
}

impl StoreError {
    /// A few words for a person.
    pub const fn text(self) -> &'static str {
        match self {
            Self::BadRange => "storage: too few or uneven pages of flash",
            Self::Flash => "storage: the flash failed",
            Self::NotStored => "storage: the flash does not hold the values",
        }
    }
}

/// Reads the parameters from `range` of the flash, whatever is in it. A value that was not stored, or
/// that this firmware does not know or accept, is the default.
pub fn load<F: NorFlash>(flash: &mut F, range: Range<u32>) -> (Params, Integrity) {
    let read = |halves| {
        let found = Found::look(flash, &halves)?;
        Ok((found.newest.params(flash)?, found.integrity()))
    };
    halves::<F>(range)
        .and_then(read)
        .unwrap_or_else(|_: StoreError| (Params::default(), Integrity::Unreadable))
}

/// Writes a new set if the values are not those that are stored, and looks whether it stands. When it
/// is done the values survive the loss of power.
///
/// A default that was never stored is not written; what this firmware does not know is kept.
///
/// # Errors
/// Any [`StoreError`]; what was stored before is still there then, or these values are.
pub fn save<F: NorFlash>(
    flash: &mut F,
    range: Range<u32>,
    params: &Params,
) -> Result<(), StoreError> {
    let halves = halves::<F>(range)?;
    let found = Found::look(flash, &halves)?;
    let old = found.newest;
    if found.whole && old.params(flash)? == *params {
        return Ok(());
    }
    let [first, second] = &halves;
    let (here, there) = if first.contains(&old.values.start) {
        (first, second)
    } else {
        (second, first)
    };
    let bytes_max = old.values.len() as u32 + (TABLE.len() as u32 + 1) * Word::BYTES;
    let stays = found.whole && here.end - old.after >= bytes_max;
    if !stays {
        if there.len() < bytes_max as usize {
            return Err(StoreError::NotStored);
        }
        wipe(flash, there)?;
    }
    let mut writer = Writer {
        at: if stays { old.after } else { there.start },
        number: old.number.wrapping_add(1),
        hash: HASH_BASIS,
    };
    writer.write(flash, &old, params)?;

    let new = Found::look(flash, &halves)?.newest;
    if new.number != writer.number || new.params(flash)? != *params {
        return Err(StoreError::NotStored);
    }
    // What is not whole would be found again.
    if found.whole {
        Ok(())
    } else {
        wipe(flash, here)
    }
}

/// Forgets all stored values: the next [`load`] gives the defaults.
///
/// # Errors
/// [`StoreError::BadRange`] and [`StoreError::Flash`].
pub fn erase<F: NorFlash>(flash: &mut F, range: Range<u32>) -> Result<(), StoreError> {
    halves::<F>(range)?
        .iter()
        .try_for_each(|half| wipe(flash, half))
}

fn wipe<F: NorFlash>(flash: &mut F, half: &Range<u32>) -> Result<(), StoreError> {
    flash
        .erase(half.start, half.end)
        .map_err(|_| StoreError::Flash)
}

fn halves<F: NorFlash>(range: Range<u32>) -> Result<[Range<u32>; 2], StoreError> {
    let middle = range.start.midpoint(range.end);
    let halves = [range.start..middle, middle..range.end];
    let pages = |half: &Range<u32>| {
        !half.is_empty()
            && half.start.is_multiple_of(F::ERASE_SIZE as u32)
            && half.end.is_multiple_of(F::ERASE_SIZE as u32)
    };
    if halves.iter().all(pages) {
        Ok(halves)
    } else {
        Err(StoreError::BadRange)
    }
}

/// What the flash is read and written by.
struct Word {
    key: u16,
    /// That of its set.
    number: u16,
    /// A value's, or the hash of the set.
    bits: u32,
}

impl Word {
    const BYTES: u32 = 8;

    fn read<F: NorFlash>(flash: &mut F, at: u32) -> Result<Self, StoreError> {
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

    /// As an erase leaves it.
    fn is_blank(&self) -> bool {
        self.bytes() == [0xFF; Self::BYTES as usize]
    }

    /// The parameter whose value it is; derived parameters are not stored.
    fn id(&self) -> Option<ParamId> {
        ParamId::ALL
            .into_iter()
            .find(|id| id.entry().key == self.key && id.entry().kind != Kind::Derived)
    }

    /// A hash (FNV-1a) over this and what was before.
    fn hash(&self, before: u32) -> u32 {
        self.bytes().into_iter().fold(before, |hash, byte| {
            (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
        })
    }
}

const HASH_BASIS: u32 = 0x811c_9dc5;

/// Where in the flash a set is.
#[derive(Clone)]
struct Set {
    /// Its words but for the seal.
    values: Range<u32>,
    /// Behind the seal.
    after: u32,
    /// One more than that of the set before.
    number: u16,
}

impl Set {
    fn params<F: NorFlash>(&self, flash: &mut F) -> Result<Params, StoreError> {
        let mut params = Params::default();
        for at in self.values.clone().step_by(Word::BYTES as usize) {
            let word = Word::read(flash, at)?;
            if let Some(id) = word.id() {
                // What is out of range has been stored by another version of the firmware.
                let _ = params.set(id, f32::from_bits(word.bits));
            }
        }
        Ok(params)
    }
}

/// What the flash holds.
struct Found {
    /// Of the sets with their seals; without words if there is none.
    newest: Set,
    /// Whether all that is written belongs to such a set.
    whole: bool,
    /// Whether all that is written may belong to a first set.
    first: bool,
}

impl Found {
    fn look<F: NorFlash>(flash: &mut F, halves: &[Range<u32>; 2]) -> Result<Self, StoreError> {
        let origin = halves[0].start;
        let mut found = Self {
            newest: Set {
                values: origin..origin,
                after: origin,
                number: FIRST - 1,
            },
            whole: true,
            first: true,
        };
        for half in halves {
            let mut start = half.start;
            let mut number = FIRST;
            let mut hash = HASH_BASIS;
            let mut whole = true;
            for at in half.clone().step_by(Word::BYTES as usize) {
                let word = Word::read(flash, at)?;
                if word.is_blank() {
                    continue;
                }
                if whole || word.number != number {
                    found.whole &= whole;
                    (start, number, hash) = (at, word.number, HASH_BASIS);
                }
                found.first &= number == FIRST;
                whole = word.key == SEAL && word.bits == hash;
                hash = word.hash(hash);
                let newest = &found.newest;
                let is_newer = number.wrapping_sub(newest.number).cast_signed() > 0;
                if whole && (newest.values.is_empty() || is_newer) {
                    found.newest = Set {
                        values: start..at,
                        after: at + Word::BYTES,
                        number,
                    };
                }
            }
            found.whole &= whole;
        }
        Ok(found)
    }

    fn integrity(&self) -> Integrity {
        match (self.newest.values.is_empty(), self.whole) {
            (false, true) => Integrity::Sound,
            (true, true) => Integrity::Empty,
            (true, false) if !self.first => Integrity::Corrupt,
            (_, false) => Integrity::Incomplete,
        }
    }
}

/// Writes a set.
struct Writer {
    at: u32,
    number: u16,
    hash: u32,
}

impl Writer {
    /// The words of the set before, with the values in force, and what is not in it and no default.
    fn write<F: NorFlash>(
        &mut self,
        flash: &mut F,
        old: &Set,
        params: &Params,
    ) -> Result<(), StoreError> {
        let mut written = [false; TABLE.len()];
        for at in old.values.clone().step_by(Word::BYTES as usize) {
            let mut word = Word::read(flash, at)?;
            if let Some(id) = word.id() {
                word.bits = params.get(id).to_bits();
                written[id as usize] = true;
            }
            self.put(flash, word.key, word.bits)?;
        }
        for (id, written) in ParamId::ALL.into_iter().zip(written) {
            let entry = id.entry();
            if !written && entry.kind != Kind::Derived && params.get(id) != entry.default {
                self.put(flash, entry.key, params.get(id).to_bits())?;
            }
        }
        self.put(flash, SEAL, self.hash)
    }

    fn put<F: NorFlash>(&mut self, flash: &mut F, key: u16, bits: u32) -> Result<(), StoreError> {
        const { assert!((Word::BYTES as usize).is_multiple_of(F::WRITE_SIZE)) }
        let word = Word {
            key,
            number: self.number,
            bits,
        };
        flash
            .write(self.at, &word.bytes())
            .map_err(|_| StoreError::Flash)?;
        self.hash = word.hash(self.hash);
        self.at += Word::BYTES;
        Ok(())
    }
}

#[cfg(test)]
mod tests;
