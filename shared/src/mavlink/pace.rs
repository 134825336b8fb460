//! Shares of a link.

/// A share of a link's bytes, so that what can wait does not hold up what cannot.
///
/// The level counts millionths of a byte: whole numbers only, the same on every machine.
#[derive(Clone, Debug)]
pub(super) struct Pace {
    bytes_per_s: u32,
    level: u64,
    last_us: u64,
}

const MILLIONTHS: u64 = 1_000_000;

impl Pace {
    /// A share of `bytes_per_s`, full.
    pub(super) fn new(bytes_per_s: u32) -> Self {
        let mut pace = Self {
            bytes_per_s,
            level: 0,
            last_us: 0,
        };
        pace.level = pace.most();
        pace
    }

    /// What may leave at once: 20 ms of the share, but always the longest frame.
    fn most(&self) -> u64 {
        (u64::from(self.bytes_per_s) * (MILLIONTHS / 50)).max(280 * MILLIONTHS)
    }

    /// Lets time pass.
    pub(super) fn advance(&mut self, now_us: u64) {
        let passed_us = now_us.saturating_sub(self.last_us);
        self.last_us = now_us;
        self.level = passed_us
            .saturating_mul(u64::from(self.bytes_per_s))
            .saturating_add(self.level)
            .min(self.most());
    }

    /// Takes `len` bytes if they may leave now.
    pub(super) fn take(&mut self, len: usize) -> bool {
        match self.level.checked_sub(len as u64 * MILLIONTHS) {
            Some(rest) => {
                self.level = rest;
                true
            }
            None => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_is_kept_over_a_second() {
        let mut pace = Pace::new(5760);
        let mut sent_bytes = 0;
        for now_ms in 0..=1000 {
            pace.advance(now_ms * 1000);
            while pace.take(37) {
                sent_bytes += 37;
            }
        }
        // A second's share and the first burst.
        assert!(
            (5760 - 37..=5760 + 280).contains(&sent_bytes),
            "{sent_bytes}"
        );
    }

    #[test]
    fn a_slow_link_still_sends_the_longest_frame() {
        assert!(Pace::new(1).take(280));
        assert!(!Pace::new(1).take(281));
    }
}
