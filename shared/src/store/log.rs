//! A log of sets in two halves of the flash, in which two sets always hold the settings.

use core::ops::Range;

use embedded_storage::nor_flash::NorFlash;

use super::error::{Integrity, StoreError};
use super::set::{Content, FIRST, Set};
use super::word::{Check, Word, Writer, key};

/// The contents of the flash.
pub(super) struct Log {
    halves: [Range<u32>; 2],
    /// The newest sealed set; empty if there is none.
    pub(super) newest: Set,
    before: Set,
    /// Everything written belongs to a sealed set.
    whole: bool,
    /// Everything written may belong to a first set.
    first: bool,
}

impl Log {
    /// Scans the flash.
    pub(super) fn open<F: NorFlash>(flash: &mut F, range: Range<u32>) -> Result<Self, StoreError> {
        Self::look(flash, halves::<F>(range)?)
    }

    fn look<F: NorFlash>(flash: &mut F, halves: [Range<u32>; 2]) -> Result<Self, StoreError> {
        let (mut newest, mut before) = (Set::NONE, Set::NONE);
        let (mut all_whole, mut first, mut torn) = (true, true, false);
        for half in halves.clone() {
            let mut start = half.start;
            let mut number = FIRST;
            let mut check = Check::ORIGIN;
            let mut whole = true;
            for at in half.step_by(Word::BYTES as usize) {
                let word = Word::read(flash, at)?;
                if word.is_blank() {
                    continue;
                }
                if whole || word.number != number {
                    all_whole &= whole;
                    (start, number, check) = (at, word.number, Check::ORIGIN);
                }
                // The last word of a torn write may have any number.
                first &= !torn;
                torn = number != FIRST;
                // A seal covers at least one word.
                whole = word.key == key::SEAL && at != start && word.bits == check.0;
                check = check.over(&word);
                if !whole {
                    continue;
                }
                let set = Set {
                    values: start..at,
                    after: at + Word::BYTES,
                    number,
                };
                if set.is_newer(&newest) {
                    before = core::mem::replace(&mut newest, set);
                } else if set.is_newer(&before) {
                    before = set;
                }
            }
            all_whole &= whole;
        }
        Ok(Self {
            halves,
            newest,
            before,
            whole: all_whole,
            first,
        })
    }

    pub(super) fn integrity(&self) -> Integrity {
        match (self.newest.values.is_empty(), self.whole) {
            (false, true) => Integrity::Sound,
            (true, true) => Integrity::Empty,
            (false, false) => Integrity::Incomplete,
            (true, false) if self.first => Integrity::Unfinished,
            (true, false) => Integrity::Corrupt,
        }
    }

    /// Returns the half with the newest set, then the other one.
    fn order(&self) -> [&Range<u32>; 2] {
        let [first, second] = &self.halves;
        if second.contains(&self.newest.values.start) {
            [second, first]
        } else {
            [first, second]
        }
    }

    /// Appends a set with this content, unless the newest has it and the previous one has its settings. Returns
    /// true if it wrote one.
    pub(super) fn append<F: NorFlash>(
        &self,
        flash: &mut F,
        content: &Content,
    ) -> Result<bool, StoreError> {
        let newest = &self.newest;
        let len = length(flash, content)?;
        // In empty flash, a schema without values adds nothing.
        let nothing = newest.values.is_empty() && len == 2 * Word::BYTES;
        if self.whole
            && (nothing
                || (newest.has(flash, content, false)? && self.before.has(flash, content, true)?))
        {
            return Ok(false);
        }
        let [here, there] = self.order();
        let behind = newest.after.max(here.start);
        if self.whole && here.end - behind >= len {
            self.write(flash, content, behind)?;
            return Ok(true);
        }
        self.move_to(flash, content, there, len)?;
        // A later scan would find the incomplete set again.
        if !self.whole {
            wipe(flash, here)?;
        }
        Ok(true)
    }

    /// Stores this content and nothing else.
    pub(super) fn replace<F: NorFlash>(
        &self,
        flash: &mut F,
        content: &Content,
    ) -> Result<(), StoreError> {
        let len = length(flash, content)?;
        let [here, there] = self.order();
        self.move_to(flash, content, there, len)?;
        wipe(flash, here)
    }

    /// Erases a half and writes a set of this length to it.
    fn move_to<F: NorFlash>(
        &self,
        flash: &mut F,
        content: &Content,
        half: &Range<u32>,
        len: u32,
    ) -> Result<(), StoreError> {
        if half.end - half.start < len {
            return Err(StoreError::NotStored);
        }
        wipe(flash, half)?;
        self.write(flash, content, half.start)
    }

    /// Writes a set and verifies it.
    fn write<F: NorFlash>(
        &self,
        flash: &mut F,
        content: &Content,
        at: u32,
    ) -> Result<(), StoreError> {
        let mut writer = Writer::new(at, self.newest.number.wrapping_add(1));
        let mut content = content.clone();
        while let Some((key, bits)) = content.next(flash)? {
            writer.put(flash, key, bits)?;
        }
        writer.seal(flash)?;
        let new = Self::look(flash, self.halves.clone())?.newest;
        if (new.number, new.after) == (writer.number, writer.at) {
            Ok(())
        } else {
            Err(StoreError::NotStored)
        }
    }
}

/// Returns the length of a set with this content, including its seal.
fn length<F: NorFlash>(flash: &mut F, content: &Content) -> Result<u32, StoreError> {
    let mut content = content.clone();
    let mut len = Word::BYTES;
    while content.next(flash)?.is_some() {
        len += Word::BYTES;
    }
    Ok(len)
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
