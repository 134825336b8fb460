//! Checks the legs' switches: none may turn on before the other one of its leg has been off for the dead time.
//!
//! It sees each edge when the stage does, timed by the stage's own clock. So it knows nothing of the timers that it
//! checks; nor of what is broken: a shorted switch is on, but nobody has turned it on.

use super::super::rail::Rail;

/// Rounding error of a dead time, s.
const ROUNDING_S: f64 = 1e-12;

/// The state of the legs' switches.
#[derive(Clone, Debug)]
pub(super) struct Guard {
    /// Time required between the switches of a leg, s.
    dead_s: f64,
    /// The switch of each leg that is on.
    on: [Option<Rail>; 3],
    /// The last one turned off.
    last: [Rail; 3],
    /// When, within the period, s.
    off_s: [f64; 3],
    /// A leg that had less in this period.
    crossed: Option<usize>,
}

impl Guard {
    /// Creates a guard with all switches off for long.
    pub(super) fn new() -> Self {
        Self {
            dead_s: 0.0,
            on: [None; 3],
            last: [Rail::Low; 3],
            off_s: [f64::NEG_INFINITY; 3],
            crossed: None,
        }
    }

    /// Begins a period with this dead time, after one of `past_s`.
    #[inline(always)] // in each period
    pub(super) fn begin(&mut self, dead_s: f64, past_s: f64) {
        self.dead_s = dead_s;
        self.crossed = None;
        for off_s in &mut self.off_s {
            *off_s -= past_s;
        }
    }

    /// Returns a leg that had less than the dead time between its switches in this period.
    pub(super) fn crossed(&self) -> Option<usize> {
        self.crossed
    }

    /// Turns on one of a leg's switches, or none.
    #[inline(always)] // at each edge
    pub(super) fn turn(&mut self, leg: usize, on: Option<Rail>, now_s: f64) {
        let before = std::mem::replace(&mut self.on[leg], on);
        if before == on {
            return;
        }
        if let Some(rail) = before {
            self.last[leg] = rail;
            self.off_s[leg] = now_s;
        }
        if let Some(rail) = on {
            let off_for_s = now_s - self.off_s[leg];
            if self.last[leg] != rail && off_for_s < self.dead_s - ROUNDING_S {
                self.crossed = Some(leg);
            }
        }
    }

    /// Moves each leg to a rail, with this much time between its switches.
    #[inline(always)] // in each half of a period
    pub(super) fn sweep(&mut self, to: Rail, dead_s: f64) {
        if dead_s < self.dead_s - ROUNDING_S {
            self.crossed = Some(0);
        }
        self.on = [Some(to); 3];
    }

    /// Puts the legs at a rail, as if for long, without an edge.
    pub(super) fn hold(&mut self, rail: Rail) {
        self.on = [Some(rail); 3];
    }
}
