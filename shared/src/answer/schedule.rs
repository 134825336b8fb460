//! Schedules extended telemetry among the replies.

/// A kind of extended word sent in rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Status,
    Temperature,
    Voltage,
    Current,
    Stress,
}

/// The rotation: status and temperature once, the rest twice.
const TURN: [Kind; 8] = [
    Kind::Status,
    Kind::Current,
    Kind::Voltage,
    Kind::Stress,
    Kind::Temperature,
    Kind::Current,
    Kind::Voltage,
    Kind::Stress,
];

/// Time from one extended word to the next: 16 per second, a rotation in half a second. They take 0.2 % of the
/// speed words at 8 kHz and a third at 50 Hz, and one a second remains down to 2 frames a second.
pub(super) const SLOT_US: u32 = 62_500;

/// The schedule. It counts ticks between replies.
#[derive(Clone, Debug)]
pub(super) struct Schedule {
    slot_ticks: u32,
    /// Ticks since the slot of the last extended word began.
    since_ticks: u32,
    next: usize,
    /// The last reply was an extended word: no two in succession.
    was_extended: bool,
}

impl Schedule {
    /// Creates a schedule whose slots last this many ticks.
    pub(super) fn new(slot_ticks: u32) -> Self {
        Self {
            slot_ticks,
            since_ticks: 0,
            next: 0,
            was_extended: false,
        }
    }

    /// Restarts with the status word, one slot from now.
    pub(super) fn begin(&mut self) {
        self.since_ticks = 0;
        self.next = 0;
    }

    /// Adds the time since the previous reply.
    pub(super) fn pass(&mut self, ticks: u32) {
        self.since_ticks = self.since_ticks.saturating_add(ticks);
    }

    /// Returns true if this reply may be an extended word. Call it once per reply.
    pub(super) fn is_free(&mut self) -> bool {
        !core::mem::take(&mut self.was_extended)
    }

    /// Records that this reply is an extended word.
    pub(super) fn sends(&mut self) {
        self.was_extended = true;
    }

    /// Returns the word that is due, if any.
    pub(super) fn due(&mut self) -> Option<Kind> {
        if self.since_ticks < self.slot_ticks {
            return None;
        }
        // Make up for one late slot; drop any more.
        self.since_ticks = (self.since_ticks - self.slot_ticks).min(self.slot_ticks);
        let kind = TURN[self.next];
        self.next = (self.next + 1) % TURN.len();
        Some(kind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Returns the words sent in this many frames at this interval, with their positions.
    fn kinds(interval_us: u32, frames: usize) -> Vec<(usize, Kind)> {
        let mut schedule = Schedule::new(SLOT_US);
        let mut kinds = Vec::new();
        for frame in 0..frames {
            schedule.pass(interval_us);
            if schedule.is_free()
                && let Some(kind) = schedule.due()
            {
                schedule.sends();
                kinds.push((frame, kind));
            }
        }
        kinds
    }

    #[test]
    fn at_any_frame_rate_there_is_one_a_second_and_never_two_in_a_row() {
        for rate_hz in [2, 3, 10, 33, 50, 490, 1000, 8000, 17_400] {
            let kinds = kinds(1_000_000 / rate_hz, 20 * rate_hz as usize);
            let places: Vec<_> = kinds.iter().map(|(place, _)| *place).collect();
            assert!(places[0] < rate_hz as usize, "{rate_hz} Hz");
            for pair in places.windows(2) {
                let gap = pair[1] - pair[0];
                assert!((2..=rate_hz.max(2) as usize).contains(&gap), "{rate_hz} Hz");
            }
        }
    }

    #[test]
    fn every_kind_has_its_rate() {
        for rate_hz in [50, 1000, 8000] {
            let kinds = kinds(1_000_000 / rate_hz, 10 * rate_hz as usize);
            let count = |wanted| kinds.iter().filter(|(_, kind)| *kind == wanted).count();
            for (kind, a_second) in [
                (Kind::Status, 2),
                (Kind::Temperature, 2),
                (Kind::Voltage, 4),
                (Kind::Current, 4),
                (Kind::Stress, 4),
            ] {
                let ten_seconds = count(kind);
                assert!(
                    (10 * a_second - 1..=10 * a_second).contains(&ten_seconds),
                    "{ten_seconds} of {kind:?} at {rate_hz} Hz"
                );
            }
        }
    }
}
