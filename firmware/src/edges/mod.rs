//! The edges of the throttle wire from the capturing timer, in two rings. Times have 32 bits whatever
//! the timer has.
//!
//! Nothing here touches the chip: closures read it.

mod ring;
#[cfg(test)]
mod tests;

use ring::Ring;
pub(crate) use ring::{LEN, Memory};

/// Bits of a DShot frame: so many edges of each direction.
const BITS: usize = 16;

/// The edges, by a timer of so many bits.
pub(crate) struct Edges<const TIMER_BITS: u32> {
    /// Rising, falling.
    rings: [Ring; 2],
    /// An edge that is younger may not be in memory yet.
    settling_ticks: u32,
    last_ticks: u32,
    settled_ticks: u32,
}

impl<const TIMER_BITS: u32> Edges<TIMER_BITS> {
    /// The greatest value of the timer's counter.
    const MASK: u32 = u32::MAX >> (32 - TIMER_BITS);

    /// None yet. An edge is in its memory, that of the rising or that of the falling ones, so many ticks after
    /// it at the latest.
    pub(crate) fn new(memories: [&'static Memory; 2], settling_ticks: u32) -> Self {
        Self {
            rings: [Ring::new(memories[0]), Ring::new(memories[1])],
            settling_ticks,
            last_ticks: 0,
            settled_ticks: 0,
        }
    }

    /// The time, which wraps after 32 bits, by what the counter shows. A timer with fewer is extended: this
    /// must be called within each of its turns.
    pub(crate) fn now(&mut self, shown: u32) -> u32 {
        let passed = shown.wrapping_sub(self.last_ticks) & Self::MASK;
        self.last_ticks = self.last_ticks.wrapping_add(passed);
        self.last_ticks
    }

    /// Takes in what has come, by what the counter shows and how many times the DMA of each ring has left.
    /// False if some were lost: the task was kept from its work for longer than the memory lasts.
    pub(crate) fn fill(&mut self, shown: impl Fn() -> u32, left: impl Fn(usize) -> usize) -> bool {
        // The edges up to here are in memory by then.
        self.settled_ticks = self.now(shown()).wrapping_sub(self.settling_ticks);
        let [rising, falling] = &mut self.rings;
        let whole = rising.fill(left(0)) & falling.fill(left(1));
        // And none of them comes after this: it would be dated a turn of the counter back.
        self.now(shown());
        whole
    }

    /// An edge's time, by what the timer showed then.
    fn time(&self, shown: u32) -> u32 {
        let before_ticks = self.last_ticks.wrapping_sub(shown) & Self::MASK;
        self.last_ticks.wrapping_sub(before_ticks)
    }

    /// The next edge of a direction.
    fn front(&self, direction: usize) -> Option<u32> {
        let ring = &self.rings[direction];
        (ring.count() > 0).then(|| self.time(ring.word(0)))
    }

    /// The time since an edge; negative while it is too young.
    fn age(&self, ticks: u32) -> i32 {
        self.settled_ticks.wrapping_sub(ticks) as i32
    }

    /// The first edge that has come.
    pub(crate) fn first(&self) -> Option<u32> {
        match [self.front(0), self.front(1)] {
            [Some(rising), Some(falling)] if self.age(rising) > self.age(falling) => Some(rising),
            [rising, falling] => falling.or(rising),
        }
    }

    /// True if the line was high before them, and the first and the second edge of each of 16 bits, if as many
    /// edges have come as a frame has.
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

    /// Returns true if as many edges have come as a frame has.
    pub(crate) fn has_frame(&self) -> bool {
        self.rings.iter().all(|ring| ring.count() >= BITS)
    }

    /// Returns true if this time was still to come at the last look.
    pub(crate) fn is_before(&self, until_ticks: u32) -> bool {
        until_ticks.wrapping_sub(self.last_ticks) as i32 > 0
    }

    /// Leaves a frame's edges behind. False if they were overwritten while they were read.
    pub(crate) fn skip_frame(&mut self) -> bool {
        let whole = !self.rings.iter().any(Ring::is_torn);
        for ring in &mut self.rings {
            ring.skip(BITS);
        }
        whole
    }

    /// Leaves behind what came before the last frame that has begun, if there is something: whether there was.
    /// A frame begins with an edge of this direction, and within it the next of those never comes so late.
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

    /// Leaves behind the edges before a time.
    pub(crate) fn skip_before(&mut self, ticks: u32) {
        for direction in 0..2 {
            let is_before = |at: u32| (at.wrapping_sub(ticks) as i32) < 0;
            while self.front(direction).is_some_and(is_before) {
                self.rings[direction].skip(1);
            }
        }
    }

    /// Gives out the edges that have come, with the level after each, in their order.
    pub(crate) fn take(&mut self, mut give: impl FnMut(u32, bool)) {
        while let Some((at_ticks, level)) = self.next() {
            give(at_ticks, level);
        }
    }

    /// The time up to which [`Edges::take`] has given out every edge.
    pub(crate) fn settled(&self) -> u32 {
        self.settled_ticks
    }

    /// The next edge of both directions. One that is too young waits: an older one of the other
    /// direction may still be on its way into memory. None as well if it was overwritten meanwhile.
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

    /// Forgets the edges that have come.
    pub(crate) fn forget(&mut self) {
        for ring in &mut self.rings {
            ring.clear();
        }
    }
}
