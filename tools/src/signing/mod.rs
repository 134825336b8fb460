//! MAVLink 2 message signing: what this program sends has the owner's key on it, and what it believes has too.
//!
//! The `mavlink` crate signs only with the standard library, which excludes the feature that the ESC builds it with.

mod file;

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use mavlink::calculate_crc;
use sha2::{Digest, Sha256};

use crate::error::Error;
use file::KeyFile;
pub(crate) use file::{create, passphrase};

/// A secret shared with the ESC.
pub(crate) type Key = [u8; 32];

/// Incompatibility flag of a signed frame, in the third byte.
const SIGNED: u8 = 1;
/// Bytes after a signed frame's check: link, timestamp, hash.
const SIGNATURE: usize = 13;
const TIMESTAMP: usize = 6;
const HASH: usize = 6;

/// The start of timestamps, 2015, s since 1970; they count 10 µs.
const EPOCH_S: u64 = 1_420_070_400;
const TICKS_PER_S: u64 = 100_000;

/// Timestamps that the file says are used before they are, so that a program that is killed uses none twice: 10 s.
const AHEAD: u64 = 10 * TICKS_PER_S;

/// Returns true if a whole frame is signed.
pub(crate) fn is_signed(frame: &[u8]) -> bool {
    frame.first() == Some(&0xFD) && frame.get(2).is_some_and(|flags| flags & SIGNED != 0)
}

/// Returns true if this key has signed a frame.
pub(crate) fn fits(key: &Key, frame: &[u8]) -> bool {
    match frame.split_last_chunk::<HASH>() {
        Some((signed, hash)) if is_signed(frame) => digest(key, signed) == *hash,
        _ => false,
    }
}

/// Signs, with timestamps that grow from run to run.
pub(crate) struct Signer {
    file: KeyFile,
    /// The latest timestamp used.
    latest: u64,
    /// Timestamps up to here are the file's.
    reserved: u64,
    /// The latest timestamp of each stream heard: a system, a component and a link.
    heard: Vec<([u8; 3], u64)>,
}

impl Signer {
    /// Takes the key in a file.
    ///
    /// # Errors
    /// [`Error::File`] if it is none, or cannot keep the time.
    pub(crate) fn open(path: &Path) -> Result<Self, Error> {
        let file = KeyFile::read(path)?;
        let mut signer = Self {
            latest: file.time,
            reserved: file.time,
            file,
            heard: Vec::new(),
        };
        signer.reserve()?;
        Ok(signer)
    }

    pub(crate) fn key(&self) -> &Key {
        &self.file.key
    }

    /// Returns a timestamp that has not been used.
    pub(crate) fn stamp(&mut self) -> u64 {
        self.latest = now().max(self.latest + 1);
        if self.latest > self.reserved {
            // If the file has become read-only, the clock alone makes the next run's times grow.
            let _ = self.reserve();
        }
        self.latest
    }

    fn reserve(&mut self) -> Result<(), Error> {
        let until = now().max(self.latest) + AHEAD;
        self.file.keep(until)?;
        self.reserved = until;
        Ok(())
    }

    /// Signs a whole frame; `extra` is the byte of its message's check.
    pub(crate) fn sign(&mut self, frame: &[u8], extra: u8) -> Vec<u8> {
        let mut signed = frame.to_vec();
        signed[2] |= SIGNED;
        let end = signed.len() - 2;
        let check = calculate_crc(&signed[1..end], extra);
        signed[end..].copy_from_slice(&check.to_le_bytes());
        signed.push(self.file.link);
        signed.extend(&self.stamp().to_le_bytes()[..TIMESTAMP]);
        let hash = digest(&self.file.key, &signed);
        signed.extend(hash);
        signed
    }

    /// Returns true if a whole frame is signed with the key, and later than all of its stream before.
    pub(crate) fn believes(&mut self, frame: &[u8]) -> bool {
        if !fits(&self.file.key, frame) {
            return false;
        }
        let [link, a, b, c, d, e, f, ..] = frame[frame.len() - SIGNATURE..] else {
            return false;
        };
        let stream = [frame[5], frame[6], link];
        let time = u64::from_le_bytes([a, b, c, d, e, f, 0, 0]);
        match self.heard.iter_mut().find(|(of, _)| *of == stream) {
            Some((_, latest)) if time <= *latest => false,
            Some((_, latest)) => {
                *latest = time;
                true
            }
            None => {
                self.heard.push((stream, time));
                true
            }
        }
    }
}

impl Drop for Signer {
    fn drop(&mut self) {
        // What was reserved stays so.
        let _ = self.file.keep(self.latest);
    }
}

/// Returns the present time as a timestamp.
fn now() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    let ticks = since.map_or(0, |since| since.as_micros() / 10);
    u64::try_from(ticks)
        .unwrap_or(u64::MAX)
        .saturating_sub(EPOCH_S * TICKS_PER_S)
}

fn digest(key: &Key, frame: &[u8]) -> [u8; HASH] {
    let whole = Sha256::new()
        .chain_update(key)
        .chain_update(frame)
        .finalize();
    let mut hash = [0; HASH];
    hash.copy_from_slice(&whole[..HASH]);
    hash
}

#[cfg(test)]
mod tests;
