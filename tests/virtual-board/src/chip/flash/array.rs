//! The store's double words and pages, and what a loss of power makes of them.

use std::collections::BTreeSet;
use std::ops::Range;

use super::ORIGIN;
use crate::chip::Unmodelled;
use crate::memory::Memory;
use crate::processor::Width;

/// Bytes of a double word.
const WORD_BYTES: u32 = 8;

/// Bytes of a page.
const PAGE_BYTES: u32 = 2048;

/// An erased double word.
const ERASED: u64 = u64::MAX;

/// A change of the store, by offsets from its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// A page has been erased.
    Erased {
        /// Where it begins.
        offset: u32,
    },
    /// A double word has been programmed. It was erased, or this is all zeros.
    Programmed {
        /// Where it begins.
        offset: u32,
        /// Its content.
        bytes: [u8; WORD_BYTES as usize],
    },
}

/// An operation that takes time.
#[derive(Clone, Debug)]
pub(super) enum Work {
    Program { address: u32, word: u64 },
    Erase { page: Range<u32> },
}

/// The store.
#[derive(Clone, Debug)]
pub(super) struct Array {
    memory: Memory,
    store: Range<u32>,
    /// Double words whose check bits do not match: each counts as one with two or more wrong bits.
    torn: BTreeSet<u32>,
    changes: Vec<Change>,
}

impl Array {
    pub(super) fn new(memory: Memory, store: Range<u32>) -> Self {
        Self {
            memory,
            store,
            torn: BTreeSet::new(),
            changes: Vec::new(),
        }
    }

    pub(super) fn take_changes(&mut self) -> Vec<Change> {
        std::mem::take(&mut self.changes)
    }

    pub(super) fn read(&self, address: u32, width: Width) -> Result<u32, Unmodelled> {
        let bytes = width.bytes();
        let is_within = self.store.contains(&address) && address.is_multiple_of(bytes);
        let value = || self.memory.read(address, bytes);
        is_within.then(value).ok_or(Unmodelled)
    }

    pub(super) fn is_torn(&self, address: u32) -> bool {
        self.torn.contains(&(address & !(WORD_BYTES - 1)))
    }

    /// Returns whether the double word at this address is erased.
    pub(super) fn is_erased(&self, address: u32) -> Result<bool, Unmodelled> {
        let is_within = self.store.contains(&address);
        let word = is_within.then(|| self.word(address)).ok_or(Unmodelled)?;
        Ok(word == ERASED && !self.is_torn(address))
    }

    /// Returns the erase of a page of the store, by its number in the flash.
    pub(super) fn erase(&self, page: u8) -> Result<Work, Unmodelled> {
        let start = ORIGIN + u32::from(page) * PAGE_BYTES;
        let page = start..start + PAGE_BYTES;
        let is_within = self.store.start <= page.start && page.end <= self.store.end;
        is_within.then_some(Work::Erase { page }).ok_or(Unmodelled)
    }

    /// Completes an operation.
    pub(super) fn finish(&mut self, work: &Work) {
        match work {
            Work::Program { address, word } => {
                self.torn.remove(address);
                self.put(*address, *word);
            }
            Work::Erase { page } => self.clear(page),
        }
    }

    /// Cuts off an operation: some of the bits that were to change have, by this seed.
    pub(super) fn tear(&mut self, work: &Work, seed: u64) {
        let mut random = Random(seed);
        match work {
            Work::Program { address, word } => {
                let [old, new] = [self.word(*address), *word];
                self.put_torn(*address, old, mix(old, new, &mut random), new);
            }
            Work::Erase { page } => {
                let addresses = page.clone().step_by(WORD_BYTES as usize);
                let old: Vec<_> = addresses.map(|at| (at, self.word(at))).collect();
                self.clear(page);
                for (address, old) in old {
                    let mixed = mix(old, ERASED, &mut random);
                    self.put_torn(address, old, mixed, ERASED);
                }
            }
        }
    }

    /// Writes a word; one that is neither the old nor the new one is torn.
    fn put_torn(&mut self, address: u32, old: u64, mixed: u64, new: u64) {
        if mixed != self.word(address) {
            self.put(address, mixed);
        }
        if mixed != old && mixed != new {
            self.torn.insert(address);
        }
    }

    fn word(&self, address: u32) -> u64 {
        let [low, high] = [address, address + 4].map(|at| u64::from(self.memory.read(at, 4)));
        high << 32 | low
    }

    fn put(&mut self, address: u32, word: u64) {
        let bytes = word.to_le_bytes();
        self.memory.load(address, &bytes);
        let offset = address - self.store.start;
        self.changes.push(Change::Programmed { offset, bytes });
    }

    fn clear(&mut self, page: &Range<u32>) {
        let bytes = [0xff; PAGE_BYTES as usize];
        self.memory.load(page.start, &bytes);
        self.torn.retain(|address| !page.contains(address));
        let offset = page.start - self.store.start;
        self.changes.push(Change::Erased { offset });
    }
}

/// Mixes two words bit by bit.
fn mix(one: u64, other: u64, random: &mut Random) -> u64 {
    let chosen = random.next();
    one & !chosen | other & chosen
}

/// SplitMix64, by Steele, Lea and Flood.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
    }
}
