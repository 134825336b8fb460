//! Lifetime statistics.

use crate::drive::{Fault, Faults, Phase};

const SECOND_US: u32 = 1_000_000;

/// Totals and maxima since the first power-up; a reset to factory settings does not clear them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Time driven, s.
    pub run_s: u32,
    /// Successful starts.
    pub starts: u32,
    /// Occurrences of each fault, in the order of [`Fault::ALL`].
    pub faults: [u32; Fault::ALL.len()],
    /// Maximum board temperature, °C; 0 if never above.
    pub temperature_max_c: f32,
    /// Maximum phase current, A, sampled every millisecond.
    pub phase_max_a: f32,
}

impl Statistics {
    /// All zero.
    pub const NONE: Self = Self {
        run_s: 0,
        starts: 0,
        faults: [0; Fault::ALL.len()],
        temperature_max_c: 0.0,
        phase_max_a: 0.0,
    };

    /// Words in storage.
    pub(crate) const WORDS: usize = 4 + Fault::ALL.len();

    /// Returns one of the words, in an order that a new fault does not disturb.
    pub(crate) fn word(&self, word: usize) -> u32 {
        match word {
            0 => self.run_s,
            1 => self.starts,
            2 => self.temperature_max_c.to_bits(),
            3 => self.phase_max_a.to_bits(),
            _ => self.faults[word - 4],
        }
    }

    /// Sets a stored word. Returns true if it is plausible.
    pub(crate) fn set_word(&mut self, word: usize, bits: u32) -> bool {
        let value = f32::from_bits(bits);
        let fits = value.is_finite() && value >= 0.0;
        match word {
            0 => self.run_s = bits,
            1 => self.starts = bits,
            2 if fits => self.temperature_max_c = value,
            3 if fits => self.phase_max_a = value,
            2 | 3 => return false,
            _ => self.faults[word - 4] = bits,
        }
        true
    }
}

/// State carried from poll to poll.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Recorder {
    faults: Faults,
    /// The motor was being driven.
    driven: bool,
    /// This drive's start has succeeded.
    started: bool,
    /// Driven time short of a whole second, µs.
    run_us: u32,
}

/// State of the drive and the board at a poll.
pub(crate) struct Inputs {
    pub(crate) phase: Phase,
    pub(crate) faults: Faults,
    pub(crate) temperature_c: f32,
    pub(crate) phase_a: f32,
    /// Time since the last poll, µs.
    pub(crate) time_us: u32,
}

impl Recorder {
    /// Takes in one poll. Returns true if the motor has just come to rest.
    pub(crate) fn poll(&mut self, statistics: &mut Statistics, inputs: &Inputs) -> bool {
        for (fault, count) in Fault::ALL.into_iter().zip(&mut statistics.faults) {
            if inputs.faults.contains(fault) && !self.faults.contains(fault) {
                *count = count.saturating_add(1);
            }
        }
        self.faults = inputs.faults;
        statistics.temperature_max_c = statistics.temperature_max_c.max(inputs.temperature_c);
        statistics.phase_max_a = statistics.phase_max_a.max(inputs.phase_a);

        let driven = inputs.phase.drives();
        let rests = self.driven && !driven;
        self.driven = driven;
        if driven {
            self.run_us = self.run_us.saturating_add(inputs.time_us);
            statistics.run_s = statistics.run_s.saturating_add(self.run_us / SECOND_US);
            self.run_us %= SECOND_US;
        }
        let runs = inputs.phase == Phase::Run;
        if runs && !self.started {
            statistics.starts = statistics.starts.saturating_add(1);
        }
        self.started = driven && (self.started || runs);
        rests
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inputs(phase: Phase) -> Inputs {
        Inputs {
            phase,
            faults: Faults::NONE,
            temperature_c: 25.0,
            phase_a: 0.0,
            time_us: 1_000,
        }
    }

    #[test]
    fn a_run_is_counted_once_and_ends_once() {
        let mut recorder = Recorder::default();
        let mut statistics = Statistics::NONE;
        let mut ends = 0;
        for _ in 0..2 {
            for (phase, polls) in [
                (Phase::Idle, 500),
                (Phase::Sense, 100),
                (Phase::Park, 250),
                (Phase::Ramp, 250),
                (Phase::Run, 600),
                (Phase::Stopping, 150),
                // Throttle is opened again before the shaft stands.
                (Phase::Run, 250),
                (Phase::Idle, 1_000),
            ] {
                for _ in 0..polls {
                    ends += usize::from(recorder.poll(&mut statistics, &inputs(phase)));
                }
            }
        }
        assert_eq!(ends, 2);
        assert_eq!(statistics.starts, 2);
        // Twice 1.5 s.
        assert_eq!(statistics.run_s, 3);
    }

    #[test]
    fn an_attempt_that_fails_is_no_start() {
        let mut recorder = Recorder::default();
        let mut statistics = Statistics::NONE;
        for _ in 0..3 {
            assert!(!recorder.poll(&mut statistics, &inputs(Phase::Park)));
            assert!(recorder.poll(&mut statistics, &inputs(Phase::Idle)));
        }
        assert_eq!(statistics.starts, 0);
    }

    #[test]
    fn a_fault_counts_when_it_begins_and_extremes_stay() {
        let mut recorder = Recorder::default();
        let mut statistics = Statistics::NONE;
        let mut stuck = Faults::NONE;
        stuck.insert(Fault::Stuck);
        for (faults, temperature_c, phase_a) in [
            (stuck, 40.0, 3.0),
            (stuck, f32::NAN, 12.5),
            (Faults::NONE, 61.0, 1.0),
            (stuck, 20.0, 0.0),
        ] {
            recorder.poll(
                &mut statistics,
                &Inputs {
                    faults,
                    temperature_c,
                    phase_a,
                    ..inputs(Phase::Idle)
                },
            );
        }
        assert_eq!(statistics.faults, [0, 0, 0, 0, 0, 2, 0, 0]);
        let highest = (statistics.temperature_max_c, statistics.phase_max_a);
        assert_eq!(highest, (61.0, 12.5));
    }

    #[test]
    fn words_are_told_apart_and_come_back() {
        let statistics = Statistics {
            run_s: 1,
            starts: 2,
            faults: [3, 4, 5, 6, 7, 8, 9, 10],
            temperature_max_c: 61.5,
            phase_max_a: 12.25,
        };
        let mut back = Statistics::default();
        for word in 0..Statistics::WORDS {
            assert!(back.set_word(word, statistics.word(word)));
        }
        assert_eq!(back, statistics);
        for bad in [f32::NAN, f32::INFINITY, -1.0] {
            for word in [2, 3] {
                assert!(!back.set_word(word, bad.to_bits()), "{word} {bad}");
            }
        }
        assert_eq!(back, statistics);
    }
}
