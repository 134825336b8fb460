//! The plant between externally generated edges: periods of any length, in stretches of any length.
//!
//! A period has one speed and one supply voltage, like those of the control. The gates are played as they come: a dead
//! time is a stretch with both off, and what comparators do is up to whoever generates the edges.

use super::super::gates::Gate;
use super::super::machine::Flow;
use super::super::timing::Timer;
use super::Plant;

impl Plant {
    /// Begins a period at a supply voltage; `expected_s` is its approximate length.
    pub fn begin(&mut self, bus_v: f64, expected_s: f64) {
        // Whoever generates the edges is responsible for the dead time between them.
        self.stage.begin(bus_v, expected_s, 0.0);
        self.settled = None;
        // The circuit's solution is prepared for halves of a period.
        self.longest_s = 0.5 * expected_s;
    }

    /// Advances the plant by a stretch with each leg's gates.
    pub fn stretch(&mut self, gates: [Gate; 3], time_s: f64) {
        for (leg, gate) in gates.into_iter().enumerate() {
            self.timers[leg] = Timer {
                output: gate.on(),
                waiting_s: 0.0,
            };
            self.stage.set_gates(leg, gate);
        }
        let mut left_s = time_s;
        while left_s > self.longest_s {
            self.stage.run(self.longest_s);
            left_s -= self.longest_s;
        }
        if left_s > 0.0 {
            self.stage.run(left_s);
        }
    }

    /// Ends a period whose stretches took `time_s`: returns the means over it, and the shaft takes its torque.
    pub fn end(&mut self, time_s: f64) -> Flow {
        let mut flow = self.stage.machine.finish(time_s);
        flow.bus_a += self.stage.shot_as() / time_s;
        flow
    }
}
