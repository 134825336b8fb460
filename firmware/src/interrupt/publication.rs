//! When the tasks get a snapshot of the control's state.

/// How often a task looks, Hz: it finds a new one each time.
const LOOKS_HZ: f32 = 1000.0;

/// Counts the periods between two snapshots. Copying one takes 133 instructions: it waits for a period in which the
/// control has little to do, but no longer than until a task looks.
pub(crate) struct Publication {
    /// Periods until one is wanted; from zero down, it is.
    left: i32,
    /// What it begins with after each.
    pause: i32,
    /// The lowest it falls to: in that period one comes in any case.
    due: i32,
}

impl Publication {
    /// Creates it for control periods of this length, with the first snapshot due in the first of them.
    pub(crate) fn new(period_s: f32) -> Self {
        // The table's 8 to 60 kHz give 8 to 60; a rate that is rounded down stays above its number.
        let most = (1.0 / (LOOKS_HZ * period_s) + 0.01) as i32;
        let due = -most / 3;
        Self {
            left: due,
            pause: most + due,
            due,
        }
    }

    /// Returns true if the snapshot is to be published in this period, called in each.
    #[inline(always)] // in each period
    pub(crate) fn is_now(&mut self, does_little: impl FnOnce() -> bool) -> bool {
        self.left -= 1;
        if self.left > 0 || self.left > self.due && !does_little() {
            return false;
        }
        self.left = self.pause;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the periods in which it publishes, of the first 1000.
    fn published(pwm_hz: f32, does_little: impl Fn(usize) -> bool) -> Vec<usize> {
        let mut publication = Publication::new(1.0 / pwm_hz);
        (0..1000)
            .filter(|n| publication.is_now(|| does_little(*n)))
            .collect()
    }

    #[test]
    fn a_task_finds_a_new_one_in_each_millisecond_at_each_frequency() {
        for pwm_khz in 8..=60 {
            for busy in [0, 1, 8, 1000] {
                let published = published(1e3 * pwm_khz as f32, |n| n % (busy + 1) == busy);
                assert_eq!(published[0], 0, "the first period has one");
                for two in published.windows(2) {
                    assert!(two[1] - two[0] <= pwm_khz, "{pwm_khz} kHz: {two:?}");
                }
            }
        }
    }

    #[test]
    fn it_waits_for_a_period_with_little_to_do() {
        let does_little = |n: usize| n % 8 == 5;
        for pwm_hz in [24e3, 48e3, 60e3] {
            let published = published(pwm_hz, does_little);
            assert!(published[1..].iter().all(|n| does_little(*n)), "{pwm_hz}");
        }
    }
}
