//! The stored values and their keys. A key is never reused for another value.

use siskin_params::{ParamId, Params, TABLE};

use crate::mavlink::{Intervals, KeptSigning, Key};
use crate::statistics::Statistics;

/// First key of the message intervals. Keys below 0x1000 are the parameters'.
const INTERVALS: u16 = 0x1100;
/// First key of the statistics.
const STATISTICS: u16 = 0x1200;
/// First key of the signing words: eight of the secret key, and the newest timestamp.
const SIGNING: u16 = 0x1300;
const SIGNING_WORDS: usize = 9;
/// Key of the newest timestamp.
const TIME: u16 = SIGNING + SIGNING_WORDS as u16 - 1;
/// Key of the time owed for saves.
const OWED: u16 = 0x1400;

/// Returns true if somebody sets the value with this key, so that an older value in its place is wrong. The
/// statistics, the signing timestamp and the owed time change by themselves.
pub(super) fn is_setting(key: u16) -> bool {
    !(STATISTICS..SIGNING).contains(&key) && key != TIME && key != OWED
}

/// The values that survive a loss of power.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Kept {
    /// Parameters.
    pub params: Params,
    /// Message intervals.
    pub intervals: Intervals,
    /// Statistics so far.
    pub statistics: Statistics,
    /// Signing key and newest timestamp, if there is a key.
    pub signing: Option<KeptSigning>,
    /// Time owed for unrequested saves, s: a restart must not give them all back.
    pub owed_s: u32,
}

/// The value that a word belongs to.
#[derive(Clone, Copy)]
enum Place {
    Param(ParamId),
    Interval(usize),
    Statistic(usize),
    Signing(usize),
    Owed,
}

impl Place {
    /// Returns the place of a word, in storage order.
    fn of(mut word: usize) -> Self {
        if let Some(id) = ParamId::ALL.get(word) {
            return Self::Param(*id);
        }
        word -= TABLE.len();
        if word < Intervals::WORDS {
            return Self::Interval(word);
        }
        word -= Intervals::WORDS;
        if word < Statistics::WORDS {
            return Self::Statistic(word);
        }
        word -= Statistics::WORDS;
        if word < SIGNING_WORDS {
            return Self::Signing(word);
        }
        Self::Owed
    }
}

impl Kept {
    /// Number of words.
    pub(super) const WORDS: usize =
        TABLE.len() + Intervals::WORDS + Statistics::WORDS + SIGNING_WORDS + 1;

    /// Returns the key of a word.
    pub(super) fn key(word: usize) -> u16 {
        match Place::of(word) {
            Place::Param(id) => id.entry().key,
            Place::Interval(word) => INTERVALS + word as u16,
            Place::Statistic(word) => STATISTICS + word as u16,
            Place::Signing(word) => SIGNING + word as u16,
            Place::Owed => OWED,
        }
    }

    /// Returns the word with this key. Parameters that are not kept have none.
    pub(super) fn find(key: u16) -> Option<usize> {
        (0..Self::WORDS).find(|word| {
            let kept = |id: &ParamId| id.entry().kind.is_kept();
            Self::key(*word) == key && ParamId::ALL.get(*word).is_none_or(kept)
        })
    }

    /// Returns the bits of a word, or `None` for the default: zero, except for parameters.
    pub(super) fn bits(&self, word: usize) -> Option<u32> {
        let bits = match Place::of(word) {
            Place::Param(id) => {
                let (entry, value) = (id.entry(), self.params.get(id));
                let stays = !entry.kind.is_kept() || value == entry.default;
                return (!stays).then_some(value.to_bits());
            }
            Place::Interval(word) => self.intervals.word(word),
            Place::Statistic(word) => self.statistics.word(word),
            Place::Signing(word) => {
                let signing = self.signing.as_ref()?;
                let part = signing.key.0.as_chunks().0.get(word);
                part.map_or(signing.newest, |part| u32::from_le_bytes(*part))
            }
            Place::Owed => self.owed_s,
        };
        (bits != 0).then_some(bits)
    }

    /// Sets a stored word. Returns true if this firmware accepts it.
    pub(super) fn set(&mut self, word: usize, bits: u32) -> bool {
        match Place::of(word) {
            Place::Param(id) => self.params.set(id, f32::from_bits(bits)).is_ok(),
            Place::Interval(word) => self.intervals.set_word(word, bits),
            Place::Statistic(word) => self.statistics.set_word(word, bits),
            Place::Signing(word) => {
                let signing = self.signing.get_or_insert(KeptSigning {
                    key: Key([0; 32]),
                    newest: 0,
                });
                match signing.key.0.as_chunks_mut().0.get_mut(word) {
                    Some(part) => *part = bits.to_le_bytes(),
                    None => signing.newest = bits,
                }
                true
            }
            Place::Owed => {
                self.owed_s = bits;
                true
            }
        }
    }
}
