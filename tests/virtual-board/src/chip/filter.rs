//! The digital filter of a timer input: a level is accepted once enough samples in a row have it.
//!
//! A change is first seen by the next sample. A change and its return between two samples restart the
//! count, though the hardware would not have seen them.

use stm32_metapac::timer::vals::FilterValue;

use crate::time::{Cycles, NEVER};

/// Samples in a row and the cycles between them, by the field's value (RM0440, TIMx_CCMR1.IC1F and
/// TIM1_BDTR.BKF), with the sampling clock undivided (CKD).
const SETTINGS: [(u64, u64); 16] = [
    (0, 1),
    (2, 1),
    (4, 1),
    (8, 1),
    (6, 2),
    (8, 2),
    (6, 4),
    (8, 4),
    (6, 8),
    (8, 8),
    (5, 16),
    (6, 16),
    (8, 16),
    (5, 32),
    (6, 32),
    (8, 32),
];

/// A filter, with input and output low at first.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    input: bool,
    changed_at: Cycles,
    output: bool,
    samples: u64,
    every: u64,
}

impl Filter {
    /// Creates one that passes everything.
    pub(super) fn new() -> Self {
        Self {
            input: false,
            changed_at: 0,
            output: false,
            samples: 0,
            every: 1,
        }
    }

    /// Sets it from its field.
    pub(super) fn set(&mut self, value: FilterValue) {
        (self.samples, self.every) = SETTINGS[usize::from(value.to_bits())];
    }

    /// Takes the input level.
    pub(super) fn input(&mut self, level: bool, now: Cycles) {
        if self.input != level {
            self.input = level;
            self.changed_at = now;
        }
    }

    /// Returns the input level.
    pub(super) fn level(&self) -> bool {
        self.input
    }

    /// Returns the output level.
    pub(super) fn output(&self) -> bool {
        self.output
    }

    /// Returns when the output changes, if the input stays.
    pub(super) fn due(&self) -> Cycles {
        if self.input == self.output {
            NEVER
        } else if self.samples == 0 {
            self.changed_at
        } else {
            (self.changed_at / self.every + self.samples) * self.every
        }
    }

    /// Does what is due; returns whether the output has changed.
    pub(super) fn act(&mut self, now: Cycles) -> bool {
        let changes = self.due() <= now;
        if changes {
            self.output = self.input;
        }
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filter(value: FilterValue) -> Filter {
        let mut filter = Filter::new();
        filter.set(value);
        filter
    }

    #[test]
    fn a_level_passes_after_its_samples() {
        let mut filter = filter(FilterValue::FCK_INT_N4);
        filter.input(true, 100);
        assert_eq!(filter.due(), 104);
        assert!(!filter.act(103));
        assert!(!filter.output());
        assert!(filter.act(104));
        assert!(filter.output());
        assert_eq!(filter.due(), NEVER);
    }

    #[test]
    fn a_spike_vanishes() {
        let mut filter = filter(FilterValue::FCK_INT_N4);
        filter.input(true, 100);
        filter.input(false, 103);
        assert_eq!(filter.due(), NEVER);
        filter.input(true, 104);
        assert_eq!(filter.due(), 108);
    }

    #[test]
    fn the_slow_samples_lie_on_the_divided_clock() {
        let mut filter = filter(FilterValue::FDTS_DIV16_N6);
        // Samples at 112, 128, 144, 160, 176, 192.
        filter.input(true, 100);
        assert_eq!(filter.due(), 192);
    }

    #[test]
    fn without_samples_everything_passes_at_once() {
        let mut filter = filter(FilterValue::NO_FILTER);
        filter.input(true, 7);
        assert_eq!(filter.due(), 7);
    }
}
