//! A ring in memory into which the DMA writes the edge times of one direction.
//!
//! The DMA's position gives the number of edges. No interrupt counts its laps: it would have to run before the
//! throttle task looks, and delay it. A full lap shows in the time before the next one, which is the first to
//! be overwritten.

use core::sync::atomic::{AtomicU32, Ordering};

/// Edges of one direction that fit between two looks: two DShot frames.
pub(crate) const LEN: usize = 32;

/// Memory for the ring.
pub(crate) type Memory = [AtomicU32; LEN];

/// The ring.
pub(super) struct Ring {
    memory: &'static Memory,
    /// Index of the next time, and of the DMA at the last look.
    at: usize,
    end: usize,
    /// The time before the next one: a change there shows that the DMA has lapped.
    before: u32,
    /// The DMA had lapped when times were skipped.
    torn: bool,
}

impl Ring {
    /// Creates an empty ring.
    pub(super) fn new(memory: &'static Memory) -> Self {
        let mut ring = Self {
            memory,
            at: 0,
            end: 0,
            before: 0,
            torn: false,
        };
        ring.clear();
        ring
    }

    /// Takes in new times, with the DMA `left` transfers from its wrap. Returns false, and empties the ring, if
    /// more came than the memory holds, since the last look or while it was read.
    pub(super) fn fill(&mut self, left: usize) -> bool {
        self.end = (LEN - left) % LEN;
        let whole = !self.is_torn();
        if !whole {
            self.clear();
        }
        whole
    }

    /// Returns true if the DMA has lapped: what was read last may belong to any edge.
    pub(super) fn is_torn(&self) -> bool {
        self.torn || self.word(LEN - 1) != self.before
    }

    /// Empties the ring.
    pub(super) fn clear(&mut self) {
        self.skip(self.count());
        self.torn = false;
    }

    /// Skips `count` times.
    pub(super) fn skip(&mut self, count: usize) {
        self.torn = self.is_torn();
        self.at = (self.at + count) % LEN;
        self.before = self.word(LEN - 1);
    }

    /// Returns the number of times held.
    pub(super) fn count(&self) -> usize {
        (self.end + LEN - self.at) % LEN
    }

    /// Returns one of the times; the next is 0.
    pub(super) fn word(&self, index: usize) -> u32 {
        self.words()(index)
    }

    /// Returns access to the times; the next is 0.
    pub(super) fn words(&self) -> impl Fn(usize) -> u32 + use<> {
        let (memory, at) = (self.memory, self.at);
        move |index| memory[(at + index) % LEN].load(Ordering::Relaxed)
    }
}
