//! Flash storage that survives a loss of power.
//!
//! A save appends all values as one set, 8 bytes per value, followed by a seal over them. The newest sealed set
//! counts, so a loss of power leaves all values of this save or all of the previous one. When a setting has
//! changed, the set is written twice, so that bit rot in one leaves the other; when only the statistics or the
//! signing timestamp have changed, the previous set has the same settings anyway. The flash is used in two
//! halves. When one is full, or anything in it is incomplete, the other is erased and takes the set; the sets
//! it replaces stay until the new one is written and verified.
//!
//! # Wear
//! A set with twenty changed parameters, the statistics and a key has 44 words, 352 bytes. On the STM32G431 a
//! half is one 2 KB page, which lasts for 10 000 erases (DS12589) and fits 5 sets: 100 000 saves of statistics,
//! or 50 000 changes of settings. With up to 40 changed parameters it is at least 40 000 changes, and with
//! every value changed 20 000. The STM32F405's two 16 KB sectors (10 000 erases, DS8626) last at least eight
//! times as long.

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

/// Sets that hold the settings saved last.
const COPIES: usize = 2;

/// The stored values.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The values, with the default for any that was not stored or is rejected.
    pub kept: Kept,
    /// Integrity of the storage.
    pub integrity: Integrity,
    /// A value was rejected; the next save drops it.
    pub out_of_range: bool,
    /// Some values are unknown to this firmware; saves preserve them.
    pub unknown: bool,
}

impl Loaded {
    /// Returns the trouble that the user must know of, if any.
    pub const fn trouble(&self) -> Option<&'static str> {
        match self.integrity {
            Integrity::Incomplete => Some("storage: incomplete, an older save may apply"),
            Integrity::Unfinished => Some("storage: first save cut off"),
            Integrity::Corrupt => Some("storage: corrupt, using the defaults"),
            Integrity::Unreadable => Some("storage: unreadable, using the defaults"),
            _ if self.out_of_range => Some("storage: out of range, using some defaults"),
            _ if self.unknown => Some("storage: values of another firmware are kept"),
            Integrity::Sound | Integrity::Empty => None,
        }
    }
}

/// Loads the stored values from `range` of the flash, whatever its contents.
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

/// Writes what is not stored yet, and verifies it. On success the values survive a loss of power, and the
/// settings are stored twice.
///
/// Defaults are not written; values unknown to this firmware are preserved.
///
/// # Errors
/// Any [`StoreError`]; then either the previous values or these are still stored.
pub fn save<F: NorFlash>(flash: &mut F, range: Range<u32>, kept: &Kept) -> Result<(), StoreError> {
    for _ in 0..COPIES {
        let log = Log::open(flash, range.clone())?;
        if !log.append(flash, &Content::new(kept, log.newest.values()))? {
            break;
        }
    }
    Ok(())
}

/// Stores these values and nothing else: no values unknown to this firmware, and no earlier save.
///
/// # Errors
/// As for [`save`].
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
