//! Storage that survives a loss of power, in flash.
//!
//! A save appends all values as one set, of 8 bytes a value, and ends it with a seal over them. The
//! newest set with its seal counts, so a loss of power leaves all values of this save, or all of the
//! one before. If a setting has changed the set is written twice, so that a rotten bit in one leaves
//! the other; if only the statistics or the time of signatures have changed, the set before has the
//! same settings. The flash is used in two halves. If one is full, or anything in it is not whole, the
//! other is erased and takes the set; the sets that it replaces stay until the new one is written and
//! checked.
//!
//! # Wear
//! A set with twenty changed parameters, the statistics and a key has 43 words, 344 bytes. On the
//! STM32G431, whose pages last for 10 000 erases (DS12589) and of which a half has one of 2 KB, 5 sets
//! fit a half: it lasts for 100 000 saves of statistics, or 50 000 changes of settings. Up to 40 changed
//! parameters it is at least 40 000 changes, and with every value changed 20 000. The two sectors of the
//! STM32F405, of 16 KB (10 000 erases, DS8626), last eight times as long and more.

mod error;
mod kept;
mod log;
mod set;
mod word;

use core::ops::Range;

use embedded_storage::nor_flash::NorFlash;

pub use error::{Integrity, StoreError};
pub use kept::Kept;
use log::Log;
use set::{Content, Set};

/// Sets that have the settings which were saved last.
const COPIES: usize = 2;

/// The stored values.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The values; one that was not stored, or is not accepted, is the default.
    pub kept: Kept,
    /// Their integrity.
    pub integrity: Integrity,
    /// True if a value is not accepted; the next save drops it.
    pub out_of_range: bool,
    /// True if there are values that this firmware does not know; saves keep them.
    pub unknown: bool,
}

impl Loaded {
    /// The trouble that a person must know of, if any.
    pub const fn trouble(&self) -> Option<&'static str> {
        match self.integrity {
            Integrity::Incomplete => Some("storage: not whole, an older save may be in force"),
            Integrity::Unfinished => Some("storage: the first save was cut off"),
            Integrity::Corrupt => Some("storage: corrupt, all values are the defaults"),
            Integrity::Unreadable => Some("storage: unreadable, all values are the defaults"),
            _ if self.out_of_range => Some("storage: out of range, some values are defaults"),
            _ if self.unknown => Some("storage: values of another firmware are kept"),
            Integrity::Sound | Integrity::Empty => None,
        }
    }
}

/// Reads the stored values from `range` of the flash, whatever is in it.
pub fn load<F: NorFlash>(flash: &mut F, range: Range<u32>) -> Loaded {
    let mut loaded = Loaded {
        kept: Kept::default(),
        integrity: Integrity::Unreadable,
        out_of_range: false,
        unknown: false,
    };
    let read = Log::open(flash, range).and_then(|log| {
        let mut values = log.newest.values();
        while let Some((key, bits)) = values.next(flash)? {
            match Kept::find(key) {
                Some(word) => loaded.out_of_range |= !loaded.kept.set(word, bits),
                None => loaded.unknown = true,
            }
        }
        Ok(log.integrity())
    });
    match read {
        Ok(integrity) => loaded.integrity = integrity,
        Err(_) => loaded.kept = Kept::default(),
    }
    loaded
}

/// Writes what is not stored yet, and reads it back. When it is done the values survive the
/// loss of power, and the settings are stored twice.
///
/// Defaults are not written; values unknown to this firmware are kept.
///
/// # Errors
/// Any [`StoreError`]; what was stored before is still there then, or these values are.
pub fn save<F: NorFlash>(flash: &mut F, range: Range<u32>, kept: &Kept) -> Result<(), StoreError> {
    for _ in 0..COPIES {
        let log = Log::open(flash, range.clone())?;
        if !log.append(flash, &Content::new(kept, log.newest.values()))? {
            break;
        }
    }
    Ok(())
}

/// Leaves nothing in the flash but these values: no values unknown to this firmware, and no earlier
/// save either.
///
/// # Errors
/// As with [`save`].
pub fn replace<F: NorFlash>(
    flash: &mut F,
    range: Range<u32>,
    kept: &Kept,
) -> Result<(), StoreError> {
    let log = Log::open(flash, range.clone())?;
    log.replace(flash, &Content::new(kept, Set::NONE.values()))?;
    save(flash, range, kept)
}

#[cfg(test)]
mod tests;
