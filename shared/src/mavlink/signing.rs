//! MAVLink 2 message signing: once there is a key, only its owners may change anything.
//!
//! A timestamp counts 10 µs since 2015. It must grow within each stream of frames (a system, a component and a link),
//! whatever key signs it. It may be at most a minute older than the newest timestamp received or sent, and not older
//! than its key. The newest timestamp is stored with the key, so that a recording cannot be replayed after a loss of
//! power. It is stored along with the settings, so three things can be replayed if power fails: frames of the last two
//! seconds (of three minutes where a hundred saves have gone before), frames since the motor began to turn, and frames
//! refused since the last save.
//!
//! The ESC has no clock: it takes the time from SETUP_SIGNING and from each newer frame. A frame may be dated at most a
//! minute ahead. The first frame after a start, and the next one after a minute without any, may be further ahead,
//! since the elapsed time is unknown or may be wrong; it then sets the time, but by no more than five years at once. A
//! clock that is further off locks nobody out.

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::SETUP_SIGNING_DATA;
use sha2::{Digest, Sha256};
use siskin_units::math::divide;

use super::frame::{Address, Frame, SIGNATURE_LEN, is_signed};

const TIMESTAMP_LEN: usize = 6;
const HASH_LEN: usize = 6;

/// The link that this ESC signs for: it sends the same frames on all of them.
const LINK: u8 = 0;

/// The most that a stream may start behind the newest timestamp, and be ahead of it: a minute.
const MINUTE_TICKS: u64 = 6_000_000;
const TICK_US: u32 = 10;
const MINUTE_US: u64 = MINUTE_TICKS * TICK_US as u64;
const YEAR_TICKS: u64 = 36_525 * 864 * 1_000_000 / TICK_US as u64;
/// The most that a frame may be ahead of the newest known timestamp while the time is unknown: an ESC may have been
/// without power for so long.
const FIRST_TICKS: u64 = 5 * YEAR_TICKS;
/// The least time of a correct clock: 2026, when this was written.
const PAST: u64 = 11 * YEAR_TICKS;
/// The greatest timestamp of a SETUP_SIGNING, in 2099: others must be able to follow in 48 bits.
const SET_UP_MOST: u64 = (1 << 48) - 1 - FIRST_TICKS;

/// Streams tracked: ground stations, companions and an autopilot, each over two links.
const STREAMS: usize = 8;

/// Low bits of a timestamp that are not stored: 0.66 s.
const KEPT_SHIFT: u32 = 16;

/// The secret shared by two sides. It is never sent or printed.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Key(pub(crate) [u8; 32]);

impl core::fmt::Debug for Key {
    fn fmt(&self, formatter: &mut core::fmt::Formatter) -> core::fmt::Result {
        formatter.write_str("Key(..)")
    }
}

/// The part that survives a loss of power.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kept {
    /// The key.
    pub key: Key,
    /// The newest timestamp, in units of 0.66 s.
    pub newest: u32,
}

/// The rights of a frame's sender.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Trust {
    /// Everything.
    Full,
    /// May ask, and change nothing.
    Read,
    /// None: the signature does not fit, is old, or cannot be verified.
    None,
}

/// The latest frame of a stream.
#[derive(Clone, Copy, Debug)]
struct Stream {
    from: Address,
    link: u8,
    timestamp: u64,
}

/// The key and the time.
#[derive(Clone, Debug)]
pub(super) struct Signing {
    key: Option<Key>,
    /// The newest timestamp received, and when.
    newest: u64,
    newest_us: u64,
    /// The last timestamp sent.
    sent: u64,
    /// Time of the last signed frame accepted, or of a SETUP_SIGNING that sets the time.
    told_us: Option<u64>,
    /// Everything up to here may have been received before the start or before the key.
    floor: u64,
    /// Kept across keys, so that a key that comes back finds its earlier streams.
    streams: [Option<Stream>; STREAMS],
    now_us: u64,
}

impl Signing {
    /// Without a key, before anything is known: nothing is signed.
    pub(super) const NONE: Self = Self {
        key: None,
        newest: 0,
        newest_us: 0,
        sent: 0,
        told_us: None,
        floor: 0,
        streams: [None; STREAMS],
        now_us: 0,
    };

    /// Starts with the stored values; without a key nothing is signed.
    pub(super) fn new(kept: Option<Kept>) -> Self {
        let floor = kept.map_or(0, |kept| ((u64::from(kept.newest) + 1) << KEPT_SHIFT) - 1);
        Self {
            key: kept.map(|kept| kept.key),
            newest: floor,
            newest_us: 0,
            sent: 0,
            told_us: None,
            floor,
            streams: [None; STREAMS],
            now_us: 0,
        }
    }

    /// Returns the part to be stored.
    pub(super) fn kept(&self) -> Option<Kept> {
        let newest = u32::try_from(self.clock() >> KEPT_SHIFT).unwrap_or(u32::MAX);
        self.key.map(|key| Kept { key, newest })
    }

    /// Handles SETUP_SIGNING: sets a key, or removes it if all zeros. Returns false if its time is impossible.
    ///
    /// Across keys time does not run backwards, and a frame already received is not accepted again.
    ///
    /// Never inlined: its stack is free for all other messages.
    #[inline(never)]
    pub(super) fn set_up(&mut self, key: [u8; 32], timestamp: u64) -> bool {
        let most = self.key.map_or(SET_UP_MOST, |_| self.latest());
        if timestamp > most.min(SET_UP_MOST) {
            return false;
        }
        let key = Some(Key(key)).filter(|key| key.0 != [0; 32]);
        if key.is_some() && key != self.key {
            self.floor = self.floor.max(timestamp.saturating_sub(1));
        }
        self.key = key;
        // A time that has not begun does not pass.
        let known = self.newest > 0;
        self.newest = timestamp.max(if known { self.clock() } else { 0 });
        self.newest_us = self.now_us;
        if timestamp > PAST {
            self.told_us = Some(self.now_us);
        }
        true
    }

    /// Sets the time since the start, which is monotonic.
    pub(super) fn advance(&mut self, now_us: u64) {
        self.now_us = now_us;
    }

    /// Returns true if outgoing frames are signed.
    pub(super) fn signs(&self) -> bool {
        self.key.is_some()
    }

    /// Judges the rights of this frame's sender.
    ///
    /// Never inlined: inside the component's own code it takes 80 bytes more.
    #[inline(never)]
    pub(super) fn judge(&mut self, frame: &Frame) -> Trust {
        match (self.key, signature(frame.raw)) {
            (None, None) => Trust::Full,
            // A client that signs from its first attempt on may have to try again.
            (None, Some(_)) if frame.id == SETUP_SIGNING_DATA::ID => Trust::Full,
            (None, Some(_)) => Trust::None,
            (Some(_), None) => Trust::Read,
            (Some(key), Some((signed, hash))) => {
                if fits(&key, signed, hash) && self.is_new(frame.from, signed) {
                    Trust::Full
                } else {
                    Trust::None
                }
            }
        }
    }

    /// Returns true if a frame whose hash fits is newer than all of its stream, and records it.
    fn is_new(&mut self, from: Address, signed: &[u8]) -> bool {
        let [.., link, a, b, c, d, e, f] = *signed else {
            return false;
        };
        let timestamp = u64::from_le_bytes([a, b, c, d, e, f, 0, 0]);
        let oldest = self.floor.max(self.clock().saturating_sub(MINUTE_TICKS));
        // A recording played back slowly falls behind, and does not hold the time back for long.
        if timestamp <= oldest || timestamp > self.latest() {
            return false;
        }
        let mine = |stream: &Option<Stream>| {
            stream.is_some_and(|stream| stream.from == from && stream.link == link)
        };
        let place = match self.streams.iter().position(mine) {
            Some(place) => Some(place).filter(|place| {
                self.streams[*place].is_none_or(|stream| timestamp > stream.timestamp)
            }),
            // A stream is forgotten once its frames are too old to begin one.
            None => self
                .streams
                .iter()
                .position(|stream| stream.is_none_or(|stream| stream.timestamp <= oldest)),
        };
        let Some(place) = place else {
            return false;
        };
        self.streams[place] = Some(Stream {
            from,
            link,
            timestamp,
        });
        if timestamp > self.clock() {
            self.newest = timestamp;
            self.newest_us = self.now_us;
        }
        self.told_us = Some(self.now_us);
        true
    }

    /// Returns the current time, as far as it is known.
    fn clock(&self) -> u64 {
        let passed = divide(self.now_us.saturating_sub(self.newest_us), TICK_US);
        self.sent.max(self.newest + passed)
    }

    /// Returns the latest time that another clock may show.
    fn latest(&self) -> u64 {
        let known = |told_us| self.now_us.saturating_sub(told_us) < MINUTE_US;
        if self.told_us.is_some_and(known) {
            self.clock() + MINUTE_TICKS
        } else {
            self.clock().max(PAST) + FIRST_TICKS
        }
    }

    /// Signs a frame, from its start to its check, with the flag set and covered by the check. Returns the signature
    /// that follows it; `None` without a key.
    pub(super) fn sign(&mut self, frame: &[u8]) -> Option<[u8; SIGNATURE_LEN]> {
        let key = self.key?;
        let timestamp = self.clock().max(self.sent + 1);
        self.sent = timestamp;
        let mut signature = [0; SIGNATURE_LEN];
        signature[0] = LINK;
        signature[1..=TIMESTAMP_LEN].copy_from_slice(&timestamp.to_le_bytes()[..TIMESTAMP_LEN]);
        let (stamp, hash) = signature.split_at_mut(SIGNATURE_LEN - HASH_LEN);
        hash.copy_from_slice(&digest(&key, &[frame, stamp]));
        Some(signature)
    }
}

/// Returns the bytes of a signed frame that its hash covers besides the key, and that hash.
fn signature(raw: &[u8]) -> Option<(&[u8], &[u8; HASH_LEN])> {
    is_signed(raw)
        .then(|| raw.split_last_chunk::<HASH_LEN>())
        .flatten()
}

fn fits(key: &Key, signed: &[u8], hash: &[u8; HASH_LEN]) -> bool {
    // Compares all bytes in constant time, so that timing reveals nothing about them.
    let wrong = digest(key, &[signed])
        .iter()
        .zip(hash)
        .fold(0, |wrong, (a, b)| wrong | (a ^ b));
    wrong == 0
}

fn digest(key: &Key, parts: &[&[u8]]) -> [u8; HASH_LEN] {
    let mut hasher = Sha256::new();
    hasher.update(key.0);
    for part in parts {
        hasher.update(part);
    }
    let whole = hasher.finalize();
    let mut hash = [0; HASH_LEN];
    for (to, byte) in hash.iter_mut().zip(whole) {
        *to = byte;
    }
    hash
}
