//! Periods that missed their deadline.

/// Weight of an overrun, in periods without one.
const WEIGHT: u32 = 100;

/// Consecutive overruns that are a fault; in time, so are more than one in 100 periods.
const REPEATED: u32 = 3;

/// Recent overruns. One is tolerated: a duty comes a period late. Repeated ones mean a processor too slow for
/// its PWM frequency, with every duty late.
#[derive(Default)]
pub(crate) struct Overruns {
    /// Falls by one per period, so that within 300 periods, most of which a retry's pause takes, all is forgotten.
    level: u32,
    /// Period of the last overrun.
    last: u32,
}

impl Overruns {
    /// Records an overrun in this period, whose number wraps. Returns true if there have been too many: at first, and
    /// at each further one as long as they come.
    #[cold]
    #[inline(never)] // only where a period is too long
    pub(crate) fn note(&mut self, period: u32) -> bool {
        let since = period.wrapping_sub(self.last);
        self.last = period;
        let level = self.level.saturating_sub(since) + WEIGHT;
        self.level = level.min(REPEATED * WEIGHT);
        level > (REPEATED - 1) * WEIGHT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the overrun that is one too many, when one occurs every `every` periods.
    fn trips_at(overruns: &mut Overruns, begin: u32, every: u32) -> Option<u32> {
        (0..1000).find(|count| overruns.note(begin.wrapping_add(count * every)))
    }

    #[test]
    fn three_in_a_row_are_a_fault() {
        assert_eq!(trips_at(&mut Overruns::default(), 77, 1), Some(2));
        assert_eq!(trips_at(&mut Overruns::default(), u32::MAX, 1), Some(2));
    }

    #[test]
    fn one_now_and_then_is_borne() {
        assert_eq!(trips_at(&mut Overruns::default(), 0, 100), None);
        assert_eq!(trips_at(&mut Overruns::default(), 0, 24_000), None);
    }

    #[test]
    fn many_that_are_not_in_a_row_are_one_too() {
        // Each leaves 50 of its weight of 100: the fourth makes 250.
        assert_eq!(trips_at(&mut Overruns::default(), 0, 50), Some(3));
    }

    #[test]
    fn the_fault_lasts_as_long_as_they_come_and_is_soon_forgotten() {
        let mut overruns = Overruns::default();
        assert_eq!(trips_at(&mut overruns, 0, 1), Some(2));
        assert!((3..100_000).all(|period| overruns.note(period)));
        assert_eq!(trips_at(&mut overruns, 100_300, 1), Some(2));
    }
}
