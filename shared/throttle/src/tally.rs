//! Measures the share of bad frames on the wire.

/// The window over which the share is measured, µs.
const WINDOW_US: u64 = 1_000_000;

/// Counts good and bad frames and pulses.
#[derive(Clone, Debug, Default)]
pub(super) struct Tally {
    bad_total: u32,
    good: u32,
    bad: u32,
    since_us: u64,
    bad_share: f32,
}

impl Tally {
    /// Counts a frame or pulse.
    pub(super) fn count(&mut self, good: bool) {
        if good {
            self.good = self.good.saturating_add(1);
        } else {
            self.bad = self.bad.saturating_add(1);
            self.bad_total = self.bad_total.saturating_add(1);
        }
    }

    /// Advances time.
    pub(super) fn poll(&mut self, now_us: u64) {
        if now_us.saturating_sub(self.since_us) < WINDOW_US {
            return;
        }
        self.since_us = now_us;
        let (good, bad) = (self.good as f32, self.bad as f32);
        self.bad_share = if bad == 0.0 { 0.0 } else { bad / (good + bad) };
        (self.good, self.bad) = (0, 0);
    }

    /// Returns the share of bad frames in the last full second, 0 to 1; 0 on a silent wire.
    pub(super) fn bad_share(&self) -> f32 {
        self.bad_share
    }

    /// Returns the number of bad frames since power-up, saturating.
    pub(super) fn bad_total(&self) -> u32 {
        self.bad_total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_is_that_of_the_last_whole_second() {
        let mut tally = Tally::default();
        let mut second = |good: u32, bad: u32, at_s: u64| {
            (0..good).for_each(|_| tally.count(true));
            (0..bad).for_each(|_| tally.count(false));
            tally.poll(at_s * WINDOW_US - 1);
            let before = tally.bad_share();
            tally.poll(at_s * WINDOW_US);
            (before, tally.bad_share())
        };
        assert_eq!(second(7_000, 1_000, 1), (0.0, 0.125));
        assert_eq!(second(0, 10, 2), (0.125, 1.0));
        assert_eq!(second(0, 0, 3), (1.0, 0.0));
        assert_eq!(second(8_000, 0, 4), (0.0, 0.0));
        assert_eq!(tally.bad_total(), 1_010);
    }
}
