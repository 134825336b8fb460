//! What a command asks of each leg's switches in half a period, and when.

use siskin_control::drive::Bridge;
use siskin_units::Duty;

use super::rail::Rail;

/// One bit of a duty.
const DUTY_BIT: f64 = 1.0 / 2_147_483_648.0;

/// One leg's timer output.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Timer {
    /// The switch that is on, or will be after the dead time.
    pub(super) output: Option<Rail>,
    /// Remaining dead time, s.
    pub(super) waiting_s: f64,
}

/// A leg's part of half a period: one output, then another.
#[derive(Clone, Copy, Debug)]
pub(super) struct Half {
    pub(super) first: Option<Rail>,
    pub(super) second: Option<Rail>,
    /// When the second begins, s.
    pub(super) edge_s: f64,
}

impl Half {
    /// Returns the half as played: the edge at its time, or at infinity if there is none.
    pub(super) fn timed(mut self, half_s: f64, dead_time_s: f64) -> Self {
        // An edge at either end does not count.
        if self.edge_s <= 0.0 {
            self.first = self.second;
        }
        if self.edge_s <= 0.0 || self.edge_s >= half_s {
            self.second = self.first;
        }
        if self.first == self.second {
            self.edge_s = f64::INFINITY;
        } else if self.first.is_some() && self.second.is_some() {
            self.edge_s = delayed(self.edge_s, dead_time_s);
        }
        self
    }
}

/// Converts an edge's time from the counter's top to the sample. With each turn-on late by the dead
/// time, the middle of the low side's on-time, which is when the sample is taken, is half a dead
/// time behind the top.
pub(super) fn delayed(edge_s: f64, dead_time_s: f64) -> f64 {
    (edge_s - 0.5 * dead_time_s).max(0.0)
}

impl Timer {
    pub(super) fn turn(&mut self, output: Option<Rail>, dead_time_s: f64) {
        // A leg that has been off needs no dead time.
        let waits = self.output.is_some() && output.is_some();
        self.waiting_s = if waits { dead_time_s } else { 0.0 };
        self.output = output;
    }

    pub(super) fn on(&self) -> Option<Rail> {
        if self.waiting_s > 0.0 {
            None
        } else {
            self.output
        }
    }

    /// Returns when the dead time ends.
    pub(super) fn next_s(&self, now_s: f64) -> f64 {
        if self.waiting_s > 0.0 {
            now_s + self.waiting_s
        } else {
            f64::INFINITY
        }
    }
}

/// Returns the duties of a command under which all legs switch, 0..1.
pub(super) fn duties(bridge: Bridge) -> Option<[f64; 3]> {
    match bridge {
        Bridge::Duty(duties) => Some(duties.map(share)),
        Bridge::Brake => Some([0.0; 3]),
        Bridge::Legs([Some(a), Some(b), Some(c)]) => Some([a, b, c].map(share)),
        Bridge::Legs(_) | Bridge::Off | Bridge::Charge(_) => None,
    }
}

/// Converts a duty to 0..1.
pub(super) fn share(duty: Duty) -> f64 {
    (f64::from(duty.to_bits()) * DUTY_BIT).min(1.0)
}

/// Returns each leg's part in the half after a sample.
pub(super) fn first_half(bridge: Bridge, half_s: f64) -> [Half; 3] {
    second_half(bridge, half_s).map(|half| Half {
        first: half.second,
        second: half.first,
        edge_s: half_s - half.edge_s,
    })
}

/// Returns the same for the half before a sample, the mirror image of the first.
pub(super) fn second_half(bridge: Bridge, half_s: f64) -> [Half; 3] {
    let off = Half {
        first: None,
        second: None,
        edge_s: half_s,
    };
    let switching = |duty| Half {
        first: Some(Rail::High),
        second: Some(Rail::Low),
        edge_s: half_s * share(duty),
    };
    match bridge {
        Bridge::Off => [off; 3],
        Bridge::Brake => [switching(Duty::ZERO); 3],
        Bridge::Duty(duties) => duties.map(switching),
        Bridge::Legs(legs) => legs.map(|leg| leg.map_or(off, switching)),
        Bridge::Charge(duty) => {
            [Half {
                first: None,
                second: Some(Rail::Low),
                edge_s: half_s * (1.0 - share(duty)),
            }; 3]
        }
    }
}
