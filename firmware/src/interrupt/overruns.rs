//! Periods that missed their deadline.

/// Weight of an overrun, in periods without one.
const WEIGHT: u32 = 100;

/// Consecutive overruns that end the drive; in time, so do more than one in 100 periods.
const REPEATED: u32 = 3;

/// Recent overruns. One is tolerated: a duty comes a period late. Repeated ones mean a processor too slow for
/// its PWM frequency, with every duty late.
#[derive(Default)]
pub(crate) struct Overruns {
    /// Falls by one per period.
    level: u32,
    /// Period of the last overrun.
    last: u32,
}

impl Overruns {
    /// Records an overrun in this period, whose number wraps. Returns true if there have been too many.
    #[cold]
    #[inline(never)] // only where a period is too long
    pub(crate) fn note(&mut self, period: u32) -> bool {
        let since = period.wrapping_sub(self.last);
        self.last = period;
        self.level = self.level.saturating_sub(since) + WEIGHT;
        self.level > (REPEATED - 1) * WEIGHT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the overrun that is one too many, when one occurs every `every` periods.
    fn ends_at(begin: u32, every: u32) -> Option<u32> {
        let mut overruns = Overruns::default();
        (0..1000).find(|count| overruns.note(begin.wrapping_add(count * every)))
    }

    #[test]
    fn three_in_a_row_end_the_drive() {
        assert_eq!(ends_at(77, 1), Some(2));
        assert_eq!(ends_at(u32::MAX, 1), Some(2));
    }

    #[test]
    fn one_now_and_then_is_borne() {
        assert_eq!(ends_at(0, 100), None);
        assert_eq!(ends_at(0, 24_000), None);
    }

    #[test]
    fn many_that_are_not_in_a_row_end_it_too() {
        // Each leaves 50 of its weight of 100: the fourth makes 250.
        assert_eq!(ends_at(0, 50), Some(3));
    }
}
