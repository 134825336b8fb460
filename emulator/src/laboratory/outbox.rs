//! MAVLink frames that wait for the program to take them.

use std::collections::VecDeque;

/// Bytes kept: at the default rates, what four ESCs send in some 20 s.
const KEPT_BYTES: usize = 65_536;

/// Frames in sending order. Untaken ones are dropped, oldest first: telemetry is only worth having while it is new.
#[derive(Debug, Default)]
pub(super) struct Outbox {
    bytes: VecDeque<u8>,
    /// The length of each frame; of the first, what is left of it.
    lengths: VecDeque<usize>,
    /// A part of the first has been taken: without the rest, the reader would lose the next one too.
    is_cut: bool,
}

impl Outbox {
    pub(super) fn push(&mut self, frame: &[u8]) {
        self.bytes.extend(frame);
        self.lengths.push_back(frame.len());
        while self.bytes.len() > KEPT_BYTES {
            let oldest = usize::from(self.is_cut);
            let Some(length) = self.lengths.remove(oldest) else {
                break;
            };
            let from = match self.is_cut {
                true => self.lengths[0],
                false => 0,
            };
            self.bytes.drain(from..from + length);
        }
    }

    /// Takes the oldest bytes, at most this many.
    pub(super) fn take(&mut self, most: usize) -> Vec<u8> {
        let count = most.min(self.bytes.len());
        let mut left = count;
        while let Some(first) = self.lengths.front_mut() {
            if left < *first {
                *first -= left;
                self.is_cut |= left > 0;
                break;
            }
            left -= *first;
            self.lengths.pop_front();
            self.is_cut = false;
        }
        self.bytes.drain(..count).collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn what_is_not_taken_goes_by_whole_frames() {
        let mut outbox = Outbox::default();
        outbox.push(&[255; 100]);
        assert_eq!(outbox.take(40), [255; 40]);
        for number in 0..=255 {
            outbox.push(&[number; 280]);
        }
        let left = outbox.take(usize::MAX);
        assert!(left.len() <= KEPT_BYTES && left.len() > KEPT_BYTES - 280);
        // The rest of the frame begun, then the latest.
        assert_eq!(left[..60], [255; 60]);
        let (frames, rest) = left[60..].as_chunks::<280>();
        assert!(rest.is_empty() && frames.iter().all(|frame| *frame == [frame[0]; 280]));
        assert!(frames.iter().map(|frame| frame[0]).is_sorted());
        assert_eq!(frames.last(), Some(&[255; 280]));
    }

    proptest! {
        #[test]
        fn all_that_is_taken_in_time_comes_in_order(frames in prop::collection::vec(1..280_usize, 1..60), most in 1..700_usize) {
            let mut outbox = Outbox::default();
            let (mut sent, mut taken) = (Vec::new(), Vec::new());
            for (number, length) in frames.into_iter().enumerate() {
                let frame = vec![number as u8; length];
                outbox.push(&frame);
                sent.extend(frame);
                taken.extend(outbox.take(most));
            }
            taken.extend(outbox.take(usize::MAX));
            prop_assert_eq!(sent, taken);
        }
    }
}
