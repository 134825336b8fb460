//! The hash over the control state of every step.

use xxhash_rust::xxh3::Xxh3;

use crate::rig::Rig;

/// Bytes that are hashed at once: the hash's set-up costs more than a period's words. Whole words.
const BYTES: usize = 16_384;

/// Hashes the words of the control state.
pub(super) struct Trace {
    hash: Xxh3,
    /// Words that have not been hashed yet, little-endian.
    bytes: Box<[u8; BYTES]>,
    len: usize,
}

impl Trace {
    pub(super) fn new() -> Self {
        Self {
            hash: Xxh3::new(),
            bytes: Box::new([0; BYTES]),
            len: 0,
        }
    }

    /// Takes in the state after a period.
    #[inline]
    pub(super) fn take(&mut self, rig: &Rig) {
        let Self { hash, bytes, len } = self;
        // A copy, which stays in a register: in memory, each word would wait for the one before.
        let mut at = *len;
        let mut take = |word: u32| {
            if at == BYTES {
                at = empty(hash, bytes);
            }
            bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
            at += 4;
        };
        rig.trace(&mut take);
        *len = at;
    }

    /// The hash so far.
    pub(super) fn digest(&self) -> u64 {
        let mut hash = self.hash.clone();
        hash.update(&self.bytes[..self.len]);
        hash.digest()
    }
}

/// Hashes a full buffer; the place of its next word. Apart, so that each word's code stays small.
#[cold]
#[inline(never)]
fn empty(hash: &mut Xxh3, bytes: &[u8; BYTES]) -> usize {
    hash.update(bytes);
    0
}
