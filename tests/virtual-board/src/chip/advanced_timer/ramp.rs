//! The centre-aligned counter: from 0 up to the top and back, in twice the top's cycles.

use crate::time::{Cycles, NEVER};

/// The ramp between two turns. The counter is at the top, and at 0, for one cycle, which is the first of
/// the next ramp.
#[derive(Clone, Debug)]
pub(super) struct Ramp {
    top: Cycles,
    down: bool,
    /// When this ramp began; `None` while it stands.
    turned_at: Option<Cycles>,
    /// How far it had come when it was stopped.
    stood: Cycles,
}

impl Ramp {
    /// Creates one that stands at 0.
    pub(super) fn new() -> Self {
        Self {
            top: 0xffff,
            down: false,
            turned_at: None,
            stood: 0,
        }
    }

    /// Returns the top.
    pub(super) fn top(&self) -> Cycles {
        self.top
    }

    /// Sets the top of a counter that stands or is turning.
    pub(super) fn set_top(&mut self, top: u16) {
        self.top = top.into();
    }

    /// Returns whether it counts down.
    pub(super) fn down(&self) -> bool {
        self.down
    }

    /// Returns when this ramp began; `None` while it stands.
    pub(super) fn turned_at(&self) -> Option<Cycles> {
        self.turned_at
    }

    /// Returns how far it has come on this ramp.
    pub(super) fn elapsed(&self, now: Cycles) -> Cycles {
        self.turned_at.map_or(self.stood, |at| now - at)
    }

    /// Returns the count.
    pub(super) fn count(&self, now: Cycles) -> u32 {
        let elapsed = self.elapsed(now);
        let count = if self.down {
            self.top.saturating_sub(elapsed)
        } else {
            elapsed
        };
        count as u32
    }

    /// Starts or stops it.
    pub(super) fn run(&mut self, runs: bool, now: Cycles) {
        self.stood = self.elapsed(now);
        self.turned_at = runs.then(|| now - self.stood);
    }

    /// Restarts at 0.
    pub(super) fn restart(&mut self, now: Cycles) {
        self.down = false;
        self.stood = 0;
        self.turned_at = self.turned_at.map(|_| now);
    }

    /// Returns when it turns next.
    pub(super) fn due(&self) -> Cycles {
        self.turned_at.map_or(NEVER, |at| at + self.top)
    }

    /// Turns around.
    pub(super) fn turn(&mut self) {
        self.turned_at = self.turned_at.map(|at| at + self.top);
        self.down = !self.down;
    }
}
