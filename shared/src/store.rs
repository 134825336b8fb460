//! Parameters in flash.
//!
//! Each value is one item of a log (`sequential-storage`) under the parameter's key, with a CRC of
//! its own; a new value is appended, and a full page moves on. A loss of power leaves each value
//! old or new. One more item, the seal, is written last and is over all values, so that a half
//! written set and a value whose item has rotted are noticed.

use core::ops::Range;

use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::Error;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

use crate::params::{Kind, ParamId, Params, TABLE};

/// Key of the seal; no parameter has it.
const SEAL: u16 = 0;
/// A key of 2 bytes and a value of 4, rounded up to the longest word that the log supports.
const BUFFER_LEN: usize = 32;

/// How sound the stored parameters were.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrity {
    /// Every value is the one that was saved.
    Sound,
    /// Nothing was stored: the values are the defaults.
    Empty,
    /// The seal does not fit: a save was interrupted, an item has rotted, or another version of
    /// the firmware has stored other parameters. A value that is missing is an older one or the
    /// default.
    Incomplete,
    /// No order was found in the flash: the values are the defaults.
    Corrupt,
    /// The flash could not be read: the values are the defaults.
    Unreadable,
}

/// What [`load`] found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadReport {
    /// How sound it was.
    pub integrity: Integrity,
    /// Parameters whose stored value is in force.
    pub loaded: u16,
    /// Stored items that are not in force: unknown keys, other sizes, values out of range.
    pub skipped: u16,
}

/// Why nothing is promised of what was stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The range is not at least two whole pages of the flash.
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

/// Reads the parameters from `range` of the flash, whatever is in it: what cannot be used is
/// reported and stays at its default.
pub async fn load<F: NorFlash>(flash: &mut F, range: Range<u32>) -> (Params, LoadReport) {
    let mut params = Params::default();
    let mut report = LoadReport {
        integrity: Integrity::Sound,
        loaded: 0,
        skipped: 0,
    };
    let mut stored = Stored::NOTHING;
    if let Err(error) = stored.read(flash, range.clone()).await {
        report.integrity = match error {
            ReadError::Corrupt => Integrity::Corrupt,
            ReadError::Store(_) => Integrity::Unreadable,
        };
        return (params, report);
    }
    report.skipped = stored.skipped;
    for (id, bits) in ParamId::ALL.into_iter().zip(&stored.items) {
        let Some(bits) = bits else { continue };
        let counter = match params.set(id, f32::from_bits(*bits)) {
            Ok(()) => &mut report.loaded,
            Err(_) => &mut report.skipped,
        };
        *counter = counter.saturating_add(1);
    }
    if stored.items[SEAL_AT] != stored.expected_seal() {
        report.integrity = Integrity::Incomplete;
    } else if stored.items[SEAL_AT].is_none() {
        report.integrity = match written_bytes(flash, range).await {
            Ok(0) => Integrity::Empty,
            Ok(count) if count <= FIRST_SAVE_BYTES => Integrity::Incomplete,
            Ok(_) => Integrity::Corrupt,
            Err(_) => Integrity::Unreadable,
        };
    }
    (params, report)
}

/// What a first save leaves at the most if it is interrupted before its first value is whole: a
/// page's mark and one item, each rounded up to the longest word.
const FIRST_SAVE_BYTES: usize = 2 * BUFFER_LEN;

/// How many bytes are not as an erase leaves them.
async fn written_bytes<F: NorFlash>(flash: &mut F, range: Range<u32>) -> Result<usize, F::Error> {
    let mut count = 0;
    let mut buffer = [0; BUFFER_LEN];
    for offset in range.step_by(BUFFER_LEN) {
        flash.read(offset, &mut buffer).await?;
        count += buffer.iter().filter(|byte| **byte != 0xFF).count();
    }
    Ok(count)
}

/// Writes what differs from what is stored, reads it back, and says how many items it wrote. When
/// it is done the values survive the loss of power.
///
/// A default that was never stored is not written. Flash that is corrupt, or full of other things,
/// is erased first.
///
/// # Errors
/// Any [`StoreError`]; values may then be old, new or, after an erase, missing. With
/// [`StoreError::Flash`] a sound set has not been erased; where it stays at that, [`erase`] heals
/// a place that has rotted.
pub async fn save<F: NorFlash>(
    flash: &mut F,
    range: Range<u32>,
    params: &Params,
) -> Result<usize, StoreError> {
    let mut stored = Stored::NOTHING;
    let sound = match stored.read(flash, range.clone()).await {
        Ok(()) => {
            stored.items[SEAL_AT].is_some() && stored.items[SEAL_AT] == stored.expected_seal()
        }
        Err(ReadError::Corrupt) => false,
        Err(ReadError::Store(error)) => return Err(error),
    };
    let mut erased = false;
    loop {
        match append(flash, range.clone(), params, &mut stored).await {
            Ok(written) => return Ok(written),
            Err(ReadError::Corrupt) if erased => return Err(StoreError::NotStored),
            Err(ReadError::Store(error)) if erased => return Err(error),
            // Flash refuses to write where something has rotted, which an erase heals. What is sound
            // is not risked for it: a flash that fails may lose it.
            Err(ReadError::Store(StoreError::Flash)) if sound => return Err(StoreError::Flash),
            Err(_) => erase(flash, range.clone()).await?,
        }
        erased = true;
    }
}

/// Forgets all stored values: the next [`load`] gives the defaults.
///
/// # Errors
/// [`StoreError::BadRange`] and [`StoreError::Flash`].
pub async fn erase<F: NorFlash>(flash: &mut F, range: Range<u32>) -> Result<(), StoreError> {
    open(flash, range)?
        .erase_all()
        .await
        .map_err(|_| StoreError::Flash)
}

type Map<'a, F> = MapStorage<u16, &'a mut F, Cache<Uncached, Uncached, Uncached, u16>>;

fn open<F: NorFlash>(flash: &mut F, range: Range<u32>) -> Result<Map<'_, F>, StoreError> {
    if range.start > range.end {
        return Err(StoreError::BadRange);
    }
    let config = MapConfig::try_new(range).map_err(|_| StoreError::BadRange)?;
    Ok(MapStorage::new(flash, config, Cache::new_uncached()))
}

enum ReadError {
    Corrupt,
    Store(StoreError),
}

impl<E> From<Error<E>> for ReadError {
    fn from(error: Error<E>) -> Self {
        match error {
            Error::Storage { .. } => Self::Store(StoreError::Flash),
            Error::FullStorage | Error::ItemTooBig => Self::Store(StoreError::NotStored),
            _ => Self::Corrupt,
        }
    }
}

impl From<StoreError> for ReadError {
    fn from(error: StoreError) -> Self {
        Self::Store(error)
    }
}

/// The seal's place behind those of the table's values.
const SEAL_AT: usize = TABLE.len();

/// What the flash holds, as bits: a value may be one that the table does not accept.
#[derive(Clone)]
struct Stored {
    items: [Option<u32>; SEAL_AT + 1],
    skipped: u16,
}

impl Stored {
    const NOTHING: Self = Self {
        items: [None; SEAL_AT + 1],
        skipped: 0,
    };

    /// Reads what the flash holds, in place of what is here: a task keeps one of these, not one for
    /// each time that it reads.
    async fn read<F: NorFlash>(
        &mut self,
        flash: &mut F,
        range: Range<u32>,
    ) -> Result<(), ReadError> {
        *self = Self::NOTHING;
        let mut map = open(flash, range)?;
        let mut buffer = [0; BUFFER_LEN];
        let mut items = map.fetch_all_items(&mut buffer).await?;
        loop {
            // Items come in the order in which they were written: the last of a key counts.
            match items.next::<u32>(&mut buffer).await {
                Ok(Some((key, bits))) => match place_of(key) {
                    Some(place) => self.items[place] = Some(bits),
                    None => self.skipped = self.skipped.saturating_add(1),
                },
                Ok(None) => return Ok(()),
                // The item is of another size, so not of this firmware; the next may be.
                Err(Error::SerializationError(_) | Error::BufferTooSmall(_)) => {
                    self.skipped = self.skipped.saturating_add(1);
                }
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// A hash (FNV-1a) over keys and values in the order of the table; none over nothing.
    fn expected_seal(&self) -> Option<u32> {
        let mut seal = None;
        for (parameter, bits) in TABLE.iter().zip(&self.items) {
            let Some(bits) = bits else { continue };
            let key = parameter.key.to_le_bytes();
            for byte in key.into_iter().chain(bits.to_le_bytes()) {
                let hash = seal.unwrap_or(0x811c_9dc5) ^ u32::from(byte);
                seal = Some(hash.wrapping_mul(0x0100_0193));
            }
        }
        seal
    }
}

/// The place of a stored key; derived parameters are not stored.
fn place_of(key: u16) -> Option<usize> {
    (0..=SEAL_AT).find(|place| match TABLE.get(*place) {
        Some(parameter) => parameter.key == key && parameter.kind != Kind::Derived,
        None => key == SEAL,
    })
}

async fn append<F: NorFlash>(
    flash: &mut F,
    range: Range<u32>,
    params: &Params,
    stored: &mut Stored,
) -> Result<usize, ReadError> {
    stored.read(flash, range.clone()).await?;
    let mut wanted = stored.clone();
    for (id, value) in ParamId::ALL.into_iter().zip(&mut wanted.items) {
        let entry = id.entry();
        let known = value.is_some() || params.get(id) != entry.default;
        if entry.kind != Kind::Derived && known {
            *value = Some(params.get(id).to_bits());
        }
    }
    wanted.items[SEAL_AT] = wanted.expected_seal();

    let mut written = 0;
    let mut map = open(flash, range.clone())?;
    let mut buffer = [0; BUFFER_LEN];
    // The seal comes last.
    for (place, (old, new)) in stored.items.iter().zip(&wanted.items).enumerate() {
        if let Some(bits) = new.filter(|_| new != old) {
            let key = TABLE.get(place).map_or(SEAL, |parameter| parameter.key);
            map.store_item(&mut buffer, &key, &bits).await?;
            written += 1;
        }
    }

    stored.read(flash, range).await?;
    if stored.items == wanted.items {
        Ok(written)
    } else {
        Err(StoreError::NotStored.into())
    }
}

#[cfg(test)]
mod tests;
