//! The gate signals of a control period, edge by edge with the dead times, for a recording.
//!
//! They are what the switching plant plays, whichever plant is simulated. A comparator trip shows
//! once the drive has responded to it.

use siskin_control::drive::Bridge;

use super::rail::Rail;
use super::timing::{Half, Timer, first_half, second_half};

/// The timer's outputs after the dead-time insertion.
#[derive(Clone, Debug, Default)]
pub struct Gates {
    timers: [Timer; 3],
}

/// Which gates of a leg are on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gate {
    /// That of the high side.
    pub high: bool,
    /// That of the low side.
    pub low: bool,
}

impl Gates {
    /// Plays a period with a command for each half, and reports each leg's changes in time order:
    /// seconds from the period's start, the leg and its gates.
    pub fn period(
        &mut self,
        halves: [Bridge; 2],
        period_s: f64,
        dead_time_s: f64,
        mut changed: impl FnMut(f64, usize, Gate),
    ) {
        let half_s = 0.5 * period_s;
        let [first, second] = halves;
        for (start_s, legs) in [
            (0.0, first_half(first, half_s)),
            (half_s, second_half(second, half_s)),
        ] {
            for (leg, (timer, half)) in self.timers.iter_mut().zip(legs).enumerate() {
                let half = half.timed(half_s, dead_time_s);
                play(timer, half, half_s, dead_time_s, |at_s, on| {
                    changed(start_s + at_s, leg, Gate::of(on));
                });
            }
        }
    }
}

/// Plays half a period of one leg.
fn play(
    timer: &mut Timer,
    half: Half,
    half_s: f64,
    dead_time_s: f64,
    mut changed: impl FnMut(f64, Option<Rail>),
) {
    let edge_s = half.edge_s.min(half_s);
    for (output, from_s, to_s) in [(half.first, 0.0, edge_s), (half.second, edge_s, half_s)] {
        if from_s == half_s {
            return;
        }
        if timer.output != output {
            timer.turn(output, dead_time_s);
            changed(from_s, timer.on());
        }
        if timer.waiting_s > 0.0 {
            if from_s + timer.waiting_s < to_s {
                changed(from_s + timer.waiting_s, output);
                timer.waiting_s = 0.0;
            } else {
                timer.waiting_s -= to_s - from_s;
            }
        }
    }
}

impl Gate {
    fn of(on: Option<Rail>) -> Self {
        Self {
            high: on == Some(Rail::High),
            low: on == Some(Rail::Low),
        }
    }

    /// Returns true if both are on.
    pub fn shoots(self) -> bool {
        self.high && self.low
    }

    /// Returns the one that is on, if only one is.
    pub(super) fn on(self) -> Option<Rail> {
        match (self.low, self.high) {
            (true, false) => Some(Rail::Low),
            (false, true) => Some(Rail::High),
            _ => None,
        }
    }
}
