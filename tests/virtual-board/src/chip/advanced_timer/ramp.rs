//! The centre-aligned counter: from 0 up to the top and back, in twice the top's cycles.

use crate::time::{Cycles, NEVER};

/// The way between two turns. The counter is at the top, and at 0, for one cycle, which is the first
/// of the next way.
#[derive(Clone, Debug)]
pub(super) struct Ramp {
    top: Cycles,
    down: bool,
    /// When it began this way; none while it stands.
    turned_at: Option<Cycles>,
    /// How far it had come when it was stopped.
    stood: Cycles,
}

impl Ramp {
    /// Standing at 0.
    pub(super) fn new() -> Self {
        Self {
            top: 0xffff,
            down: false,
            turned_at: None,
            stood: 0,
        }
    }

    /// The top.
    pub(super) fn top(&self) -> Cycles {
        self.top
    }

    /// Sets the top, of a counter that stands or turns.
    pub(super) fn set_top(&mut self, top: u16) {
        self.top = top.into();
    }

    /// Whether it counts down.
    pub(super) fn down(&self) -> bool {
        self.down
    }

    /// When it began this way; none while it stands.
    pub(super) fn turned_at(&self) -> Option<Cycles> {
        self.turned_at
    }

    /// How far it has come on this way.
    pub(super) fn elapsed(&self, now: Cycles) -> Cycles {
        self.turned_at.map_or(self.stood, |at| now - at)
    }

    /// The counter.
    pub(super) fn count(&self, now: Cycles) -> u32 {
        let elapsed = self.elapsed(now);
        let count = if self.down {
            self.top.saturating_sub(elapsed)
        } else {
            elapsed
        };
        count as u32
    }

    /// Lets it run or stand.
    pub(super) fn run(&mut self, runs: bool, now: Cycles) {
        self.stood = self.elapsed(now);
        self.turned_at = runs.then(|| now - self.stood);
    }

    /// Begins again at 0.
    pub(super) fn restart(&mut self, now: Cycles) {
        self.down = false;
        self.stood = 0;
        self.turned_at = self.turned_at.map(|_| now);
    }

    /// When it turns next.
    pub(super) fn due(&self) -> Cycles {
        self.turned_at.map_or(NEVER, |at| at + self.top)
    }

    /// Turns.
    pub(super) fn turn(&mut self) {
        self.turned_at = self.turned_at.map(|at| at + self.top);
        self.down = !self.down;
    }
}
