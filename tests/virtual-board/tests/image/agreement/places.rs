//! Finds where in a memory the words of a series are, by elimination: a place that has held a word after
//! each period so far may be its own.
//!
//! The compiler chooses the layout of the chip's control state, and the numbers of an enumeration. A word
//! that takes thousands of values in as many periods has only its own place where each of them stood at its
//! time; words that are always equal share theirs.

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Most values that an enumeration may have.
const CODES: usize = 16;

/// Most distinct values that are counted.
const VALUES: usize = 4096;

/// A word's place: its first byte, and its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    /// Offset in the memory.
    pub(crate) at: u16,
    /// 1, 2 or 4.
    pub(crate) bytes: u16,
}

impl Place {
    /// Returns whether the value is here, zero- or sign-extended if the place is narrower.
    fn has(self, memory: &[u8], value: u32) -> bool {
        let at = usize::from(self.at);
        let here = &memory[at..at + usize::from(self.bytes)];
        match *here {
            [byte] => value == u32::from(byte) || value == byte.cast_signed() as u32,
            [low, high] => {
                let half = u16::from_le_bytes([low, high]);
                value == u32::from(half) || value == half.cast_signed() as u32
            }
            [a, b, c, d] => value == u32::from_le_bytes([a, b, c, d]),
            _ => false,
        }
    }
}

/// A byte that stands for a word.
#[derive(Clone, Debug)]
pub(crate) struct Code {
    at: u16,
    /// The word's values with the byte's.
    pairs: Vec<(u32, u8)>,
}

impl Code {
    /// Checks that byte and value still imply each other.
    fn tells(&mut self, memory: &[u8], value: u32) -> bool {
        let byte = memory[usize::from(self.at)];
        let known = |pair: &&(u32, u8)| pair.0 == value || pair.1 == byte;
        match self.pairs.iter().find(known) {
            Some(pair) => *pair == (value, byte),
            None => {
                self.pairs.push((value, byte));
                true
            }
        }
    }
}

/// A word of the series.
#[derive(Clone, Debug, Default)]
pub(crate) struct Word {
    /// Where it may be.
    pub(crate) places: Vec<Place>,
    /// Where it may be if it need not be there while it is traced as 0.
    pub(crate) while_told: Vec<Place>,
    /// Bytes that may stand for it, with a different value for each of its own: an enumeration's.
    pub(crate) codes: Vec<Code>,
    /// The last period, from 0, in which it was found anywhere.
    pub(crate) last_found: Option<u64>,
    values: BTreeSet<u32>,
    history: DefaultHasher,
}

impl Word {
    /// Returns the offsets at which it may begin, whatever its width.
    pub(crate) fn own(&self) -> BTreeSet<u16> {
        self.places.iter().map(|place| place.at).collect()
    }

    /// Returns the offsets of bytes that stand for it.
    pub(crate) fn coded(&self) -> Vec<u16> {
        self.codes.iter().map(|code| code.at).collect()
    }

    /// Returns the offsets at which it may begin if it need not be there while it is traced as 0.
    pub(crate) fn own_while_told(&self) -> BTreeSet<u16> {
        self.while_told.iter().map(|place| place.at).collect()
    }

    /// Returns how many values it has had, as far as they are counted.
    pub(crate) fn values(&self) -> usize {
        self.values.len()
    }

    /// Returns a hash shared only by words that have been equal in each period.
    pub(crate) fn history(&self) -> u64 {
        self.history.finish()
    }
}

/// The words.
#[derive(Clone, Debug, Default)]
pub(crate) struct Places {
    /// In the order of the series.
    pub(crate) words: Vec<Word>,
    /// Periods looked at.
    pub(crate) periods: u64,
    /// The memory after the first period, and which of its bytes have not changed since.
    first: Vec<u8>,
    still: Vec<bool>,
}

impl Places {
    /// Takes the values and the memory at the end of a period.
    pub(crate) fn look(&mut self, values: &[u32], memory: &[u8]) {
        if self.periods == 0 {
            let everywhere = |_: &u32| Word {
                places: everywhere(memory.len()),
                while_told: everywhere(memory.len()),
                ..Word::default()
            };
            self.words = values.iter().map(everywhere).collect();
            self.first = memory.to_vec();
            self.still = vec![true; memory.len()];
        }
        assert_eq!(values.len(), self.words.len(), "as many words each period");
        for (word, value) in self.words.iter_mut().zip(values) {
            word.places.retain(|place| place.has(memory, *value));
            if *value != 0 {
                word.while_told.retain(|place| place.has(memory, *value));
            }
            if !word.places.is_empty() {
                word.last_found = Some(self.periods);
            }
            word.codes.retain_mut(|code| code.tells(memory, *value));
            if word.values.len() < VALUES && word.values.insert(*value) {
                match word.values.len() {
                    // Until now, any unchanged byte may have stood for it.
                    2 => word.codes = codes(&word.values, *value, &self.first, &self.still, memory),
                    CODES.. => word.codes.clear(),
                    _ => {}
                }
            }
            value.hash(&mut word.history);
        }
        for ((still, byte), first) in self.still.iter_mut().zip(memory).zip(&self.first) {
            *still &= byte == first;
        }
        self.periods += 1;
    }

    /// Returns how many words, including this one, have always had the same values as this one.
    pub(crate) fn alike(&self, word: &Word) -> usize {
        let history = word.history();
        let words = self.words.iter();
        words.filter(|other| other.history() == history).count()
    }
}

/// Returns the bytes that first changed together with a word's second value.
fn codes(
    values: &BTreeSet<u32>,
    value: u32,
    first: &[u8],
    still: &[bool],
    memory: &[u8],
) -> Vec<Code> {
    let before = values.iter().find(|before| **before != value);
    let before = before.copied().unwrap_or_default();
    let changes = |at: &usize| still[*at] && memory[*at] != first[*at];
    let code = |at: usize| Code {
        at: at as u16,
        pairs: vec![(before, first[at]), (value, memory[at])],
    };
    (0..memory.len()).filter(changes).map(code).collect()
}

/// Returns all places, aligned as by the chip's compiler.
fn everywhere(bytes: usize) -> Vec<Place> {
    let aligned = |width: u16| {
        let places = (0..bytes as u16 / width).map(move |number| number * width);
        places.map(move |at| Place { at, bytes: width })
    };
    [1, 2, 4].into_iter().flat_map(aligned).collect()
}

#[test]
fn a_word_is_found_where_it_stands_and_lost_where_it_does_not() {
    let mut places = Places::default();
    for period in 0..40_u32 {
        let wide = period * 0x0101_0101;
        let mut memory = [0; 12];
        memory[4..8].copy_from_slice(&wide.to_le_bytes());
        memory[9] = (7 * period) as u8;
        memory[10] = if period < 20 { 5 } else { 3 };
        let coded = u32::from(period >= 20);
        places.look(&[wide, (7 * period) & 0xff, 0, coded], &memory);
    }
    assert!(places.words[3].places.is_empty());
    assert_eq!(places.words[3].coded(), [10]);
    let own: Vec<_> = places.words.iter().map(Word::own).collect();
    assert_eq!(own[0], [4].into());
    assert_eq!(own[1], [9].into());
    assert!(own[2].contains(&0) && !own[2].contains(&4));
    places.look(&[1, 2, 0, 1], &[0; 12]);
    assert_eq!(places.words[0].last_found, Some(39));
    assert!(places.words[3].codes.is_empty());
    assert_eq!(places.alike(&places.words[2]), 1);
}
