//! Tells a sender's frames and pulses from noise that occasionally passes the check.
//!
//! For a pulse the check is that it is like the one before, in width and in time. Of random pulses of valid width, at
//! most one in eleven is; of a sender's, all but where the throttle jumps. Such jumps count against it only at zero
//! throttle: in flight it may be noise only if it is unlike in time too.
//!
//! One random word in sixteen passes the four check bits, and nearly all of those are throttle. Each frame is
//! therefore evidence: on a link where half of the frames are good, a good one is 8 times as likely as in noise
//! (1/2 to 1/16), and a bad one half as likely (1/2 to 15/16). Their log-likelihood ratios are about 3 to −1
//! (2.08 and −0.63); their sum, clamped at both ends, is compared with a threshold.
//!
//! In random words the sum falls by 3/4 per word and then stays near 0. One word in 143 000 takes it to the
//! threshold; at 1 kHz the wire thus counts as silent within 0.2 s of the first word in all but one case in
//! 26 000. The sum rises if more than a quarter of the frames are good. On a link where half are, one good frame
//! in 2760 is missed, and at 1 kHz a silence of 0.1 s occurs once in three years. Twelve bad frames in a row
//! cost none of the good ones after them; any number costs at most four.

/// Evidence added by a good frame; a bad one subtracts 1.
const GOOD: u8 = 3;
/// Frames are believed from here on.
const BELIEVED: u8 = 15;
/// Upper clamp: after a long good run, up to twelve bad frames in a row cost no good one.
const MOST: u8 = 24;
/// The same of pulses: a stick that takes the throttle from one end to the other makes up to sixteen unlike ones.
const MOST_PULSES: u8 = 34;

/// The evidence that a wire's frames are genuine.
#[derive(Clone, Debug)]
pub(super) struct Trust(u8);

impl Default for Trust {
    /// Starts with full trust, until there are bad frames.
    fn default() -> Self {
        Self(MOST)
    }
}

impl Trust {
    /// Adds a frame that passes its check.
    pub(super) fn good(&mut self) {
        self.0 = MOST.min(self.0 + GOOD);
    }

    /// Adds a pulse that does.
    pub(super) fn good_pulse(&mut self) {
        self.0 = MOST_PULSES.min(self.0 + GOOD);
    }

    /// Returns true if the wire is to be believed.
    pub(super) fn believes(&self) -> bool {
        self.0 >= BELIEVED
    }

    /// Adds one that fails it.
    pub(super) fn bad(&mut self) {
        self.0 = self.0.saturating_sub(1);
    }

    #[cfg(test)]
    pub(super) fn count(&self) -> u8 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec;
    use std::vec::Vec;

    /// Returns the probability of each count after many frames with this share of good ones, in random order.
    fn counts(good: f64) -> Vec<f64> {
        let mut counts = vec![0.0; usize::from(MOST) + 1];
        counts[usize::from(MOST)] = 1.0;
        for _ in 0..5_000 {
            let mut next = vec![0.0; counts.len()];
            for (count, likely) in (0..=MOST).zip(&counts) {
                let (mut risen, mut fallen) = (Trust(count), Trust(count));
                risen.good();
                fallen.bad();
                next[usize::from(risen.0)] += likely * good;
                next[usize::from(fallen.0)] += likely * (1.0 - good);
            }
            counts = next;
        }
        counts
    }

    /// Returns the share of frames that are good and believed.
    fn believed(good: f64) -> f64 {
        let counts = counts(good);
        let believes = |count: u8| {
            let mut trust = Trust(count);
            trust.good();
            trust.believes()
        };
        let likely = (0..=MOST).filter(|count| believes(*count));
        good * likely.map(|count| counts[usize::from(count)]).sum::<f64>()
    }

    #[test]
    fn of_random_words_one_in_143_000_is_believed() {
        let share = believed(1.0 / 16.0);
        assert!((1.0 / share - 143_000.0).abs() < 1_000.0, "{share:e}");
    }

    #[test]
    fn of_a_link_that_half_fails_one_good_frame_in_2760_is_missed() {
        for (good, missed) in [(1.0 / 3.0, 0.061), (0.5, 1.0 / 2_758.0), (0.73, 5e-8)] {
            let share = 1.0 - believed(good) / good;
            assert!((share / missed - 1.0).abs() < 0.02, "{good}: {share:e}");
        }
    }

    #[test]
    fn twelve_bad_frames_cost_nothing_and_any_number_four_good_ones() {
        for (bad, cost) in [(12, 0), (13, 1), (1_000, 4)] {
            let mut trust = Trust::default();
            (0..bad).for_each(|_| trust.bad());
            let missed = (0..100)
                .take_while(|_| {
                    trust.good();
                    !trust.believes()
                })
                .count();
            assert_eq!(missed, cost, "{bad}");
        }
    }
}
