//! The hash over the control state of every step.

use xxhash_rust::xxh3::Xxh3;

use crate::rig::Rig;
use crate::surroundings::{Motion, Passage};

/// Bytes that wait to be hashed at once, at most: the hash's set-up costs more than a period's words.
const BYTES: usize = 16_384;

/// Bytes of one period's words, at most: there are some 200 of four.
const PERIOD_BYTES: usize = 4_096;

/// Hashes the words of the control state.
pub(super) struct Trace {
    hash: Xxh3,
    /// Words, little-endian, with room for a period's behind them.
    bytes: Box<[u8; BYTES + PERIOD_BYTES]>,
    /// How many of them have not been hashed yet.
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

    /// Takes in the state after a period.
    #[inline]
    pub(super) fn take(&mut self, rig: &Rig) {
        let Some(room) = self.room() else { return };
        let mut len = 0;
        rig.trace(&mut |word: u32| {
            room[len..len + 4].copy_from_slice(&word.to_le_bytes());
            len += 4;
        });
        self.waiting += len;
    }

    /// Takes in what the motor did in a period.
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

    /// Room for a period behind what waits, where each word has a fixed place: nothing is checked word by word.
    #[inline]
    fn room(&mut self) -> Option<&mut [u8; PERIOD_BYTES]> {
        if self.waiting > BYTES {
            self.hash.update(&self.bytes[..self.waiting]);
            self.waiting = 0;
        }
        self.bytes[self.waiting..].first_chunk_mut()
    }

    /// The hash so far.
    pub(super) fn digest(&self) -> u64 {
        let mut hash = self.hash.clone();
        hash.update(&self.bytes[..self.waiting]);
        hash.digest()
    }
}
