//! Shares of a link's rate.

/// A share of a link's bytes, so that messages that can wait do not delay the others.
#[derive(Clone, Debug)]
pub(super) struct Pace {
    bytes_per_s: u32,
    /// Time at which all bytes taken so far will have been sent.
    free_us: u64,
}

/// Bytes that may always leave at once: the longest frame, or all of the control's signals, signed.
const AT_ONCE_MAX: usize = 480;

/// Bytes that may otherwise leave at once, as time of the share.
const BURST_US: u64 = 20_000;

impl Pace {
    /// Creates a share of `bytes_per_s`, none of it taken.
    pub(super) fn new(bytes_per_s: u32) -> Self {
        Self {
            bytes_per_s: bytes_per_s.max(1),
            free_us: 0,
        }
    }

    fn time_us(&self, len: usize) -> u64 {
        (len as u32 * 1_000_000).div_ceil(self.bytes_per_s).into()
    }

    /// Takes at most [`AT_ONCE_MAX`] bytes, if they may leave now.
    pub(super) fn take(&mut self, now_us: u64, len: usize) -> bool {
        let free_us = self.free_us.max(now_us).saturating_add(self.time_us(len));
        let may = free_us - now_us <= self.time_us(AT_ONCE_MAX).max(BURST_US);
        if may {
            self.free_us = free_us;
        }
        may
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
            while pace.take(now_ms * 1000, 37) {
                sent_bytes += 37;
            }
        }
        // A second's share and the first burst.
        assert!(
            (5760 - 37..=5760 + 480).contains(&sent_bytes),
            "{sent_bytes}"
        );
    }

    #[test]
    fn a_slow_link_still_sends_the_longest() {
        assert!(Pace::new(1).take(0, 480));
        assert!(!Pace::new(1).take(0, 481));
    }
}
