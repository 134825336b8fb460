//! The pace of a serial line.

use std::time::Duration;

/// Bits per byte on the line: start, eight, stop.
const BITS_PER_BYTE: u128 = 10;

/// The number of bytes that a line has carried since it was last idle.
#[derive(Debug)]
pub(super) struct Pacer {
    baud: u32,
    busy_since: Option<Duration>,
    passed: u128,
}

impl Pacer {
    pub(super) fn new(baud: u32) -> Self {
        Self {
            baud,
            busy_since: None,
            passed: 0,
        }
    }

    /// Returns how many bytes may pass at `now`, for a line busy since it was last idle.
    pub(super) fn budget(&mut self, now: Duration) -> usize {
        let since = *self.busy_since.get_or_insert(now);
        let bits = now.saturating_sub(since).as_nanos() * u128::from(self.baud) / 1_000_000_000;
        let budget = (bits / BITS_PER_BYTE).saturating_sub(self.passed);
        usize::try_from(budget).unwrap_or(usize::MAX)
    }

    /// Counts bytes that have passed.
    pub(super) fn pass(&mut self, bytes: usize) {
        self.passed += bytes as u128;
    }

    /// Marks the line idle: unused time is not made up for.
    pub(super) fn idle(&mut self, now: Duration) {
        self.busy_since = Some(now);
        self.passed = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_busy_line_carries_its_rate_exactly() {
        let mut pacer = Pacer::new(115_200);
        let mut passed = 0;
        for us in 0..=1_000_000_u64 {
            let budget = pacer.budget(Duration::from_micros(us));
            assert!(budget <= 1, "a byte takes 86.8 µs");
            pacer.pass(budget);
            passed += budget;
        }
        assert_eq!(passed, 11_520);
    }

    #[test]
    fn idle_time_is_not_saved_up() {
        let mut pacer = Pacer::new(9600);
        assert_eq!(pacer.budget(Duration::from_secs(5)), 0);
        assert_eq!(pacer.budget(Duration::from_secs(6)), 960);
        pacer.idle(Duration::from_secs(6));
        assert_eq!(pacer.budget(Duration::from_secs(6)), 0);
        assert_eq!(pacer.budget(Duration::from_millis(6010)), 9);
        // A clock that steps back allows nothing.
        assert_eq!(pacer.budget(Duration::from_secs(1)), 0);
    }
}
