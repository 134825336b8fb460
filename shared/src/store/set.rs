//! A set of words, and the values in it.

use core::ops::Range;

use embedded_storage::nor_flash::NorFlash;

use super::error::StoreError;
use super::kept::{Kept, is_setting};
use super::word::{Word, key};

/// Number of the first set in empty flash.
pub(super) const FIRST: u16 = 1;

/// Where a set lies in the flash.
#[derive(Clone)]
pub(super) struct Set {
    /// All words but the seal.
    pub(super) values: Range<u32>,
    /// The address after the seal.
    pub(super) after: u32,
    /// One more than the previous set's.
    pub(super) number: u16,
}

impl Set {
    /// Stands for no set.
    pub(super) const NONE: Self = Self {
        values: 0..0,
        after: 0,
        number: FIRST - 1,
    };

    /// Returns true if this set was written after `than`, or `than` is no set.
    pub(super) fn is_newer(&self, than: &Self) -> bool {
        let later = self.number.wrapping_sub(than.number).cast_signed() > 0;
        than.values.is_empty() || later
    }

    /// Returns true if its words are exactly the content's, in order; with `only_settings`, comparing only
    /// settings.
    pub(super) fn has<F: NorFlash>(
        &self,
        flash: &mut F,
        content: &Content,
        only_settings: bool,
    ) -> Result<bool, StoreError> {
        let counts = |key| !only_settings || is_setting(key);
        let mut content = content.clone();
        let mut words = self.values.clone().step_by(Word::BYTES as usize);
        loop {
            let wanted = loop {
                match content.next(flash)? {
                    Some((key, _)) if !counts(key) => {}
                    next => break next,
                }
            };
            let found = loop {
                let Some(at) = words.next() else { break None };
                let word = Word::read(flash, at)?;
                if counts(word.key) {
                    break Some((word.key, word.bits));
                }
            };
            if wanted != found || wanted.is_none() {
                return Ok(wanted == found);
            }
        }
    }

    /// Returns an iterator over its values.
    pub(super) fn values(&self) -> Values {
        Values {
            words: self.values.clone(),
        }
    }
}

/// Iterates over a set's values.
#[derive(Clone)]
pub(super) struct Values {
    words: Range<u32>,
}

impl Values {
    /// Returns the key and bits of the next value.
    pub(super) fn next<F: NorFlash>(
        &mut self,
        flash: &mut F,
    ) -> Result<Option<(u16, u32)>, StoreError> {
        while !self.words.is_empty() {
            let word = Word::read(flash, self.words.start)?;
            self.words.start += Word::BYTES;
            if word.key != key::SCHEMA {
                return Ok(Some((word.key, word.bits)));
            }
        }
        Ok(None)
    }
}

/// Schema number; another one means that keys and values must be converted.
const SCHEMA: u32 = 1;

/// The words of a set to be written, without its seal: the schema, values of the previous set that this
/// firmware does not know, and every value that is not the default.
#[derive(Clone)]
pub(super) struct Content<'a> {
    schema: Option<u32>,
    old: Values,
    kept: &'a Kept,
    words: Range<usize>,
}

impl<'a> Content<'a> {
    pub(super) fn new(kept: &'a Kept, old: Values) -> Self {
        Self {
            schema: Some(SCHEMA),
            old,
            kept,
            words: 0..Kept::WORDS,
        }
    }

    /// Returns the key and bits of the next word.
    pub(super) fn next<F: NorFlash>(
        &mut self,
        flash: &mut F,
    ) -> Result<Option<(u16, u32)>, StoreError> {
        if let Some(schema) = self.schema.take() {
            return Ok(Some((key::SCHEMA, schema)));
        }
        while let Some((key, bits)) = self.old.next(flash)? {
            if Kept::find(key).is_none() {
                return Ok(Some((key, bits)));
            }
        }
        let next = |word| Some((Kept::key(word), self.kept.bits(word)?));
        Ok(self.words.find_map(next))
    }
}
