//! A ring in memory into which the DMA puts the times of one direction's edges.
//!
//! The DMA's position gives the number of edges. No interrupt counts its rounds: that would have to run
//! before the throttle's task looks, and would hold it up. A whole round is noticed by the time before
//! the next one, which is the first to be overwritten.

use core::sync::atomic::{AtomicU32, Ordering};

/// Edges of one direction that the memory takes between two looks: two DShot frames.
pub(crate) const LEN: usize = 32;

/// The memory.
pub(crate) type Memory = [AtomicU32; LEN];

/// The ring.
pub(super) struct Ring {
    memory: &'static Memory,
    /// The place of the next time, and that of the DMA at the last look.
    at: usize,
    end: usize,
    /// The time before the next one: a change there shows that the DMA has come round.
    before: u32,
    /// The DMA had come round when times were left behind.
    torn: bool,
}

impl Ring {
    /// An empty one.
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

    /// Takes in what has come, the DMA being so many times from its wrap. False if more came than
    /// the memory takes, since the last look or while it was read: what the ring has is forgotten.
    pub(super) fn fill(&mut self, left: usize) -> bool {
        self.end = (LEN - left) % LEN;
        let whole = !self.is_torn();
        if !whole {
            self.clear();
        }
        whole
    }

    /// Returns true if the DMA has come round: what was read last may be any edge's.
    pub(super) fn is_torn(&self) -> bool {
        self.torn || self.word(LEN - 1) != self.before
    }

    /// Forgets its edges.
    pub(super) fn clear(&mut self) {
        self.skip(self.count());
        self.torn = false;
    }

    /// Leaves so many of the times behind.
    pub(super) fn skip(&mut self, count: usize) {
        self.torn = self.is_torn();
        self.at = (self.at + count) % LEN;
        self.before = self.word(LEN - 1);
    }

    /// The number of times that it has.
    pub(super) fn count(&self) -> usize {
        (self.end + LEN - self.at) % LEN
    }

    /// One of its times, the next is 0.
    pub(super) fn word(&self, index: usize) -> u32 {
        self.words()(index)
    }

    /// Its times, the next is 0.
    pub(super) fn words(&self) -> impl Fn(usize) -> u32 + use<> {
        let (memory, at) = (self.memory, self.at);
        move |index| memory[(at + index) % LEN].load(Ordering::Relaxed)
    }
}
