//! An up-counter behind a prescaler, computed from the time.

use crate::time::{Cycles, NEVER};

/// The counter, computed from a moment when its value was known.
#[derive(Clone, Debug)]
pub(super) struct Counter {
    runs: bool,
    /// Cycles per count.
    every: Cycles,
    /// The moment, while it runs.
    since: Cycles,
    /// Its value then.
    from: u32,
    /// Cycles that the prescaler had counted towards the next count.
    part: Cycles,
}

impl Counter {
    /// Creates one that stands at 0.
    pub(super) fn new() -> Self {
        Self {
            runs: false,
            every: 1,
            since: 0,
            from: 0,
            part: 0,
        }
    }

    /// Returns its value. It must not have overflowed since the moment.
    pub(super) fn count(&self, now: Cycles) -> u32 {
        self.from + (self.passed(now) / self.every) as u32
    }

    fn passed(&self, now: Cycles) -> Cycles {
        self.part + if self.runs { now - self.since } else { 0 }
    }

    /// Returns when it reaches this value, if that is above the current one and nothing intervenes.
    pub(super) fn arrival(&self, value: u32, now: Cycles) -> Cycles {
        if !self.runs || value <= self.count(now) {
            return NEVER;
        }
        self.overflow(value - 1)
    }

    /// Returns when it has spent a count at this value, which is not below the current one.
    pub(super) fn overflow(&self, value: u32) -> Cycles {
        if self.runs {
            let counts = Cycles::from(value - self.from) + 1;
            self.since + counts * self.every - self.part
        } else {
            NEVER
        }
    }

    /// Starts or stops it.
    pub(super) fn run(&mut self, runs: bool, now: Cycles) {
        let passed = self.passed(now);
        self.from += (passed / self.every) as u32;
        self.part = passed % self.every;
        self.since = now;
        self.runs = runs;
    }

    /// Sets its value; the prescaler continues.
    pub(super) fn set(&mut self, value: u32, now: Cycles) {
        self.run(self.runs, now);
        self.from = value;
    }

    /// Restarts it at 0, with the prescaler.
    pub(super) fn restart(&mut self, every: Cycles, now: Cycles) {
        self.every = every;
        self.since = now;
        self.from = 0;
        self.part = 0;
    }
}
