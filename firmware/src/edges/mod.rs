//! The throttle wire's edges from the capture timer, in two rings. Times have 32 bits whatever the timer's
//! width.
//!
//! Nothing here touches the chip: closures read it.

mod ring;
#[cfg(test)]
mod tests;

use ring::Ring;
pub(crate) use ring::{LEN, Memory};

/// Bits of a DShot frame, and so its edges in each direction.
const BITS: usize = 16;

/// The edges, captured by a timer with this many bits.
pub(crate) struct Edges<const TIMER_BITS: u32> {
    /// Rising, falling.
    rings: [Ring; 2],
    /// A younger edge may not be in memory yet.
    settling_ticks: u32,
    last_ticks: u32,
    settled_ticks: u32,
}

impl<const TIMER_BITS: u32> Edges<TIMER_BITS> {
    /// The counter's maximum.
    const MASK: u32 = u32::MAX >> (32 - TIMER_BITS);

    /// Creates empty rings on the memories of rising and falling edges. An edge reaches its memory at most
    /// `settling_ticks` after it occurs.
    pub(crate) fn new(memories: [&'static Memory; 2], settling_ticks: u32) -> Self {
        Self {
            rings: [Ring::new(memories[0]), Ring::new(memories[1])],
            settling_ticks,
            last_ticks: 0,
            settled_ticks: 0,
        }
    }

    /// Extends the shown counter value to a 32-bit wrapping time. With a narrower timer, call it at least once
    /// per counter turn.
    pub(crate) fn now(&mut self, shown: u32) -> u32 {
        let passed = shown.wrapping_sub(self.last_ticks) & Self::MASK;
        self.last_ticks = self.last_ticks.wrapping_add(passed);
        self.last_ticks
    }

    /// Takes in new edges, given the counter's value and the remaining count of each ring's DMA. Returns false
    /// if some were lost: the task was held up for longer than the memory lasts.
    pub(crate) fn fill(&mut self, shown: impl Fn() -> u32, left: impl Fn(usize) -> usize) -> bool {
        // Edges up to here are in memory by then.
        self.settled_ticks = self.now(shown()).wrapping_sub(self.settling_ticks);
        let [rising, falling] = &mut self.rings;
        let whole = rising.fill(left(0)) & falling.fill(left(1));
        // No edge may be later than this: it would be dated one counter turn back.
        self.now(shown());
        whole
    }

    /// Returns an edge's 32-bit time from the timer's value at it.
    fn time(&self, shown: u32) -> u32 {
        let before_ticks = self.last_ticks.wrapping_sub(shown) & Self::MASK;
        self.last_ticks.wrapping_sub(before_ticks)
    }

    /// Returns the next edge of a direction.
    fn front(&self, direction: usize) -> Option<u32> {
        let ring = &self.rings[direction];
        (ring.count() > 0).then(|| self.time(ring.word(0)))
    }

    /// Returns the time since an edge; negative while it is too young.
    fn age(&self, ticks: u32) -> i32 {
        self.settled_ticks.wrapping_sub(ticks) as i32
    }

    /// Returns the earliest edge.
    pub(crate) fn first(&self) -> Option<u32> {
        match [self.front(0), self.front(1)] {
            [Some(rising), Some(falling)] if self.age(rising) > self.age(falling) => Some(rising),
            [rising, falling] => falling.or(rising),
        }
    }

    /// Returns whether the line was high before, and the leading and trailing edge of each of 16 bits, once
    /// there are enough edges for a frame.
    pub(crate) fn frame(&self) -> Option<(bool, impl Fn(usize) -> (u32, u32) + '_)> {
        if !self.has_frame() {
            return None;
        }
        let [rising, falling] = &self.rings;
        let since = falling.word(0).wrapping_sub(rising.word(0)) & Self::MASK;
        let rests_high = since > Self::MASK / 2;
        let (first, second) = if rests_high {
            (falling, rising)
        } else {
            (rising, falling)
        };
        let (first, second) = (first.words(), second.words());
        Some((rests_high, move |bit| {
            (self.time(first(bit)), self.time(second(bit)))
        }))
    }

    /// Returns true if there are enough edges for a frame.
    pub(crate) fn has_frame(&self) -> bool {
        self.rings.iter().all(|ring| ring.count() >= BITS)
    }

    /// Returns true if this time was still ahead at the last look.
    pub(crate) fn is_before(&self, until_ticks: u32) -> bool {
        until_ticks.wrapping_sub(self.last_ticks) as i32 > 0
    }

    /// Skips a frame's edges. Returns false if they were overwritten while being read.
    pub(crate) fn skip_frame(&mut self) -> bool {
        let whole = !self.rings.iter().any(Ring::is_torn);
        for ring in &mut self.rings {
            ring.skip(BITS);
        }
        whole
    }

    /// Skips everything before the last frame that has started; returns whether there was anything. A frame
    /// starts with an edge of this direction, and within it those are always closer than `apart_ticks`.
    pub(crate) fn skip_to_last_frame(&mut self, direction: usize, apart_ticks: u32) -> bool {
        let Some(first) = self.first() else {
            return false;
        };
        let ring = &self.rings[direction];
        let word = ring.words();
        let begins = |index: &usize| {
            let before = index.checked_sub(1).map_or(first, &word);
            word(*index).wrapping_sub(before) & Self::MASK >= apart_ticks
        };
        let Some(begin) = (0..ring.count()).rev().find(begins) else {
            return false;
        };
        self.skip_before(self.time(word(begin)));
        true
    }

    /// Skips the edges before a time.
    pub(crate) fn skip_before(&mut self, ticks: u32) {
        for direction in 0..2 {
            let is_before = |at: u32| (at.wrapping_sub(ticks) as i32) < 0;
            while self.front(direction).is_some_and(is_before) {
                self.rings[direction].skip(1);
            }
        }
    }

    /// Passes the edges to `give` in order, each with the level after it.
    pub(crate) fn take(&mut self, mut give: impl FnMut(u32, bool)) {
        while let Some((at_ticks, level)) = self.next() {
            give(at_ticks, level);
        }
    }

    /// Returns the time up to which [`Edges::take`] has passed every edge.
    pub(crate) fn settled(&self) -> u32 {
        self.settled_ticks
    }

    /// Returns the next edge of either direction. One that is too young waits: an older one of the other
    /// direction may still be on its way to memory. `None` also if it was overwritten meanwhile.
    fn next(&mut self) -> Option<(u32, bool)> {
        let fronts = [self.front(0), self.front(1)];
        let [rising, falling] = fronts.map(|front| front.map(|ticks| self.age(ticks)));
        let level = rising > falling;
        let direction = usize::from(!level);
        if [rising, falling][direction]? < 0 || self.rings.iter().any(Ring::is_torn) {
            return None;
        }
        self.rings[direction].skip(1);
        Some((fronts[direction]?, level))
    }

    /// Forgets the edges received so far.
    pub(crate) fn forget(&mut self) {
        for ring in &mut self.rings {
            ring.clear();
        }
    }
}
