//! The hash over the control state of every step.

use xxhash_rust::xxh3::Xxh3;

use crate::rig::Rig;
use crate::surroundings::{Motion, Passage};

/// Most bytes buffered for one hash update, whose set-up costs more than a period's words.
const BYTES: usize = 16_384;

/// Most bytes of one period's words: there are some 200 of four.
const PERIOD_BYTES: usize = 4_096;

/// Hashes the words of the control state.
pub(super) struct Trace {
    hash: Xxh3,
    /// Words, little-endian, with room for another period's.
    bytes: Box<[u8; BYTES + PERIOD_BYTES]>,
    /// Number of bytes not hashed yet.
    waiting: usize,
}

impl Trace {
    pub(super) fn new() -> Self {
        Self {
            hash: Xxh3::new(),
            bytes: Box::new([0; BYTES + PERIOD_BYTES]),
            waiting: 0,
        }
    }

    /// Adds the state after a period.
    pub(super) fn take(&mut self, rig: &Rig) {
        let Some(room) = self.room() else { return };
        let mut len = 0;
        rig.trace(&mut |word: u32| {
            room[len..len + 4].copy_from_slice(&word.to_le_bytes());
            len += 4;
        });
        self.waiting += len;
    }

    /// Adds what the motor did in a period.
    pub(super) fn pass(&mut self, passage: &Passage) {
        let Motion {
            angle_turns,
            speed_rad_s,
            currents_a: [a, b, c],
            bus_v,
            bus_a,
            flow,
        } = passage.motion;
        let motor = [angle_turns, speed_rad_s, a, b, c, bus_v, bus_a];
        let means = [passage.length_s, flow.torque_nm];
        let Some(room) = self.room() else { return };
        let mut len = 0;
        for value in motor.into_iter().chain(means) {
            room[len..len + 8].copy_from_slice(&value.to_le_bytes());
            len += 8;
        }
        self.waiting += len;
    }

    /// Returns room for a period after what is buffered, where each word has a fixed place: no per-word checks.
    fn room(&mut self) -> Option<&mut [u8; PERIOD_BYTES]> {
        if self.waiting > BYTES {
            self.hash.update(&self.bytes[..self.waiting]);
            self.waiting = 0;
        }
        self.bytes[self.waiting..].first_chunk_mut()
    }

    /// Returns the hash so far.
    pub(super) fn digest(&self) -> u64 {
        let mut hash = self.hash.clone();
        hash.update(&self.bytes[..self.waiting]);
        hash.digest()
    }
}
