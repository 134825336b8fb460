//! Tells a sender's frames from noise that passes the check now and then.
//!
//! Of random words one in sixteen passes the four check bits, and nearly all of those are throttle. So
//! each frame is evidence: on a link where half of the frames are good, a good one is 8 times as likely
//! as in noise (1/2 to 1/16), and a bad one half as likely (1/2 to 15/16). The logarithms of the two
//! are as 3 to −1 (2.08 and −0.63): their sum, kept between two ends, is compared with a threshold.
//!
//! In random words the sum falls by 3/4 a word and then stays near 0. It reaches the threshold with one
//! word in 143 000; at 1 kHz the wire therefore counts as silent within 0.2 s of the first word in all
//! but one case of 26 000. The sum rises if more than a quarter of the frames are good. On a link where
//! half are, one good frame in 2760 is missed, and at 1 kHz a silence of a tenth of a second comes once
//! in three years. Twelve bad frames in a row cost none of the good ones after them, any number at most
//! four.

/// Evidence of a good frame; a bad one takes 1.
const GOOD: u8 = 3;
/// From here on frames are believed.
const BELIEVED: u8 = 15;
/// The end of the count: after a long good time twelve bad frames in a row raise doubt.
const MOST: u8 = 24;

/// The evidence of a wire's frames.
#[derive(Clone, Debug)]
pub(super) struct Trust(u8);

impl Default for Trust {
    /// Full trust, until there are bad frames.
    fn default() -> Self {
        Self(MOST)
    }
}

impl Trust {
    /// Takes in a frame with a right checksum. Returns true if it is to be believed.
    pub(super) fn good(&mut self) -> bool {
        self.0 = MOST.min(self.0 + GOOD);
        self.0 >= BELIEVED
    }

    /// Takes in one that fails it.
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

    /// The probability of each count after many frames of which this share is good, in any order.
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

    /// The share of frames that are good and believed.
    fn believed(good: f64) -> f64 {
        let counts = counts(good);
        let believes = |count: u8| Trust(count).good();
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
            let missed = (0..100).take_while(|_| !trust.good()).count();
            assert_eq!(missed, cost, "{bad}");
        }
    }
}
