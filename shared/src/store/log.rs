//! Sets of words, appended to two halves of the flash.

use core::ops::Range;

use embedded_storage::nor_flash::NorFlash;

use super::schema::{self, Change};
use super::word::{Check, Word, Writer};
use super::{Content, Integrity, StoreError, key};

/// Number of the first set in empty flash.
const FIRST: u16 = 1;

/// Where in the flash a set is.
#[derive(Clone)]
pub(super) struct Set {
    /// Its words but for the seal.
    pub(super) values: Range<u32>,
    /// Behind the seal.
    after: u32,
    /// One more than that of the set before.
    number: u16,
}

impl Set {
    /// No set.
    pub(super) const NONE: Self = Self {
        values: 0..0,
        after: 0,
        number: FIRST - 1,
    };

    /// Every value in it, as this firmware has it.
    pub(super) fn values<'a>(&self, changes: &'a [Change]) -> Values<'a> {
        Values {
            words: self.values.clone(),
            schema: 0,
            changes,
        }
    }
}

/// The values of a set, one after another.
#[derive(Clone)]
pub(super) struct Values<'a> {
    words: Range<u32>,
    schema: u32,
    changes: &'a [Change],
}

impl Values<'_> {
    /// Key and bits of the next one.
    pub(super) fn next<F: NorFlash>(
        &mut self,
        flash: &mut F,
    ) -> Result<Option<(u16, u32)>, StoreError> {
        while !self.words.is_empty() {
            let word = Word::read(flash, self.words.start)?;
            self.words.start += Word::BYTES;
            if word.key == key::SCHEMA {
                self.schema = word.bits;
                continue;
            }
            return Ok(Some(schema::change(
                self.changes,
                self.schema,
                word.key,
                word.bits,
            )));
        }
        Ok(None)
    }
}

/// What the flash holds.
pub(super) struct Log {
    halves: [Range<u32>; 2],
    /// Of the sets with their seals; without words if there is none.
    pub(super) newest: Set,
    /// Whether all that is written belongs to such a set.
    whole: bool,
    /// Whether all that is written may belong to a first set.
    first: bool,
}

impl Log {
    /// Looks through the flash.
    pub(super) fn open<F: NorFlash>(flash: &mut F, range: Range<u32>) -> Result<Self, StoreError> {
        Self::look(flash, halves::<F>(range)?)
    }

    fn look<F: NorFlash>(flash: &mut F, halves: [Range<u32>; 2]) -> Result<Self, StoreError> {
        let mut newest = Set::NONE;
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
                // The last word may have been cut off with any number.
                first &= !torn;
                torn = number != FIRST;
                // The check of nothing is zero, as are the words that an erase may leave.
                whole = word.key == key::SEAL && at != start && word.bits == check.0;
                check = check.over(&word);
                let is_newer = number.wrapping_sub(newest.number).cast_signed() > 0;
                if whole && (newest.values.is_empty() || is_newer) {
                    newest = Set {
                        values: start..at,
                        after: at + Word::BYTES,
                        number,
                    };
                }
            }
            all_whole &= whole;
        }
        Ok(Self {
            halves,
            newest,
            whole: all_whole,
            first,
        })
    }

    pub(super) fn integrity(&self) -> Integrity {
        match (self.newest.values.is_empty(), self.whole) {
            (false, true) => Integrity::Sound,
            (true, true) => Integrity::Empty,
            (true, false) if !self.first => Integrity::Corrupt,
            (_, false) => Integrity::Incomplete,
        }
    }

    /// The half with the newest set, and the other one.
    fn order(&self) -> [&Range<u32>; 2] {
        let [first, second] = &self.halves;
        if second.contains(&self.newest.values.start) {
            [second, first]
        } else {
            [first, second]
        }
    }

    /// Writes a set with this content behind the newest, if that has another.
    pub(super) fn append<F: NorFlash>(
        &self,
        flash: &mut F,
        content: &Content,
    ) -> Result<(), StoreError> {
        let newest = &self.newest;
        let (len, same) = self.compare(flash, content)?;
        // Where nothing is stored, a schema without values says no more.
        let nothing = newest.values.is_empty() && len == 2 * Word::BYTES;
        if self.whole && (same || nothing) {
            return Ok(());
        }
        let [here, there] = self.order();
        let behind = newest.after.max(here.start);
        if self.whole && here.end - behind >= len {
            return self.write(flash, content, behind);
        }
        self.move_to(flash, content, there, len)?;
        // What is not whole would be found again.
        if self.whole {
            Ok(())
        } else {
            wipe(flash, here)
        }
    }

    /// Leaves nothing else than this in the flash.
    pub(super) fn replace<F: NorFlash>(
        &self,
        flash: &mut F,
        content: &Content,
    ) -> Result<(), StoreError> {
        let (len, _) = self.compare(flash, content)?;
        let [here, there] = self.order();
        self.move_to(flash, content, there, len)?;
        wipe(flash, here)
    }

    /// How long a set is with its seal, and whether it has what the newest has.
    fn compare<F: NorFlash>(
        &self,
        flash: &mut F,
        content: &Content,
    ) -> Result<(u32, bool), StoreError> {
        let Range { start, end } = self.newest.values;
        let mut content = content.clone();
        let mut at = start;
        let mut same = true;
        while let Some(wanted) = content.next(flash)? {
            if same && at < end {
                let word = Word::read(flash, at)?;
                same = (word.key, word.bits) == wanted;
            }
            at += Word::BYTES;
        }
        Ok((at - start + Word::BYTES, same && at == end))
    }

    /// Writes a set of this length where nothing else stays.
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

    /// Writes a set, and looks whether it stands.
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
