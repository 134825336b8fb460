//! The hash over the control state of every step.

use xxhash_rust::xxh3::Xxh3;

use crate::rig::Rig;
use crate::surroundings::{Motion, Passage};

/// Bytes that wait to be hashed at once, at most: the hash's set-up costs more than a period's words.
const BYTES: usize = 2_048;

/// Bytes of one period's words, at most: there are some 200 of four.
const PERIOD_BYTES: usize = 4_096;

/// Hashes the words of the control state.
pub(super) struct Trace {
    hash: Xxh3,
    /// The latest period's words, little-endian.
    room: Box<[u8; PERIOD_BYTES]>,
    /// Those that have not been hashed yet.
    bytes: Vec<u8>,
}

impl Trace {
    pub(super) fn new() -> Self {
        Self {
            hash: Xxh3::new(),
            room: Box::new([0; PERIOD_BYTES]),
            bytes: Vec::with_capacity(BYTES),
        }
    }

    /// Takes in the state after a period.
    #[inline]
    pub(super) fn take(&mut self, rig: &Rig) {
        // Each word has a fixed place there: nothing is checked word by word.
        let room = &mut *self.room;
        let mut len = 0;
        rig.trace(&mut |word: u32| {
            room[len..len + 4].copy_from_slice(&word.to_le_bytes());
            len += 4;
        });
        self.keep(len);
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
        let mut len = 0;
        for value in motor.into_iter().chain(means) {
            self.room[len..len + 8].copy_from_slice(&value.to_le_bytes());
            len += 8;
        }
        self.keep(len);
    }

    /// Keeps what is in the room to be hashed.
    #[inline]
    fn keep(&mut self, len: usize) {
        if self.bytes.len() + len > BYTES {
            self.hash.update(&self.bytes);
            self.bytes.clear();
        }
        self.bytes.extend_from_slice(&self.room[..len]);
    }

    /// The hash so far.
    pub(super) fn digest(&self) -> u64 {
        let mut hash = self.hash.clone();
        hash.update(&self.bytes);
        hash.digest()
    }
}
