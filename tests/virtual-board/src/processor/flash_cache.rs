//! The flash's caches (RM0440, 3.3.4): a miss costs wait states.
//!
//! Instructions: 32 lines of four double words; constants: 8 lines. A line is filled one double word at a
//! time, on demand, and the least recently used line is replaced. With the prefetch on, the double word
//! after the one being executed is already on its way.

/// Wait states at 170 MHz in range 1 boost (RM0440, table 29).
pub(super) const WAIT_STATES: u32 = 4;

/// Bytes per line.
const LINE_BYTES: u32 = 32;

/// Bytes per flash read.
pub(super) const WORD_BYTES: u32 = 8;

/// A cache with this many lines.
#[derive(Clone, Debug)]
pub(super) struct Cache<const LINES: usize> {
    /// Tag of each place; none at the start.
    tags: [u32; LINES],
    /// Which of its double words are valid.
    filled: [u8; LINES],
    /// When each was last used.
    used: [u64; LINES],
    uses: u64,
}

impl<const LINES: usize> Cache<LINES> {
    pub(super) fn new() -> Self {
        Self {
            tags: [u32::MAX; LINES],
            filled: [0; LINES],
            used: [0; LINES],
            uses: 0,
        }
    }

    /// Fetches the bytes from `start` to `end`; returns the number of double words missing.
    pub(super) fn fetch(&mut self, start: u32, end: u32) -> u32 {
        let mut misses = 0;
        let mut line = start & !(LINE_BYTES - 1);
        while line < end {
            let from = start.max(line) - line;
            let to = (end - line).min(LINE_BYTES);
            let words = (from / WORD_BYTES)..to.div_ceil(WORD_BYTES);
            let wanted = ((1_u32 << words.end) - (1 << words.start)) as u8;
            let place = self.place(line);
            misses += (wanted & !self.filled[place]).count_ones();
            self.filled[place] |= wanted;
            line += LINE_BYTES;
        }
        misses
    }

    /// Returns a line's place, allocating one if needed.
    fn place(&mut self, line: u32) -> usize {
        self.uses += 1;
        let known = self.tags.iter().position(|tag| *tag == line);
        let place = known.unwrap_or_else(|| {
            let mut oldest = 0;
            for place in 1..LINES {
                if self.used[place] < self.used[oldest] {
                    oldest = place;
                }
            }
            self.tags[oldest] = line;
            self.filled[oldest] = 0;
            oldest
        });
        self.used[place] = self.uses;
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_been_fetched_costs_nothing_until_it_must_make_room() {
        let mut cache = Cache::<2>::new();
        // Three double words of two lines.
        assert_eq!(cache.fetch(24, 44), 3);
        assert_eq!(cache.fetch(24, 44), 0);
        // Another double word of a cached line.
        assert_eq!(cache.fetch(0, 2), 1);
        // A third line: the second is replaced, then the first is still there.
        assert_eq!(cache.fetch(64, 66), 1);
        assert_eq!(cache.fetch(24, 32), 0);
        assert_eq!(cache.fetch(32, 34), 1);
    }
}
