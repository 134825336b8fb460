//! Half a period of drive: every leg changes once from one rail, where all are, to the other.

use super::super::circuit::Sweep;
use super::super::vector::phases;
use super::{DIODE_V, Path, Rail, Stage};

impl Stage {
    /// Runs half a period in which each leg has an edge at its given time, leaving room for the dead time. Returns
    /// false, having done nothing, if a current comes too close to zero in it.
    pub(in super::super) fn sweep(
        &mut self,
        to: Rail,
        edges_s: [f64; 3],
        dead_s: f64,
        half_s: f64,
    ) -> bool {
        let rises = to == Rail::High;
        let inward = self.inward(edges_s, rises);
        // The low diode carries a current into the motor, the high one any other.
        let stays = inward.map(|inward| inward == rises);
        let at_s = [0, 1, 2].map(|leg| edges_s[leg] + if stays[leg] { dead_s } else { 0.0 });
        let [a, b, c] = edges_s;
        let sweep = Sweep {
            order: order(at_s),
            at_s,
            stays,
            rises,
            volts: 2.0 / 3.0 * self.bus_v,
            diode_v: 2.0 / 3.0 * DIODE_V,
            dead_s,
            overlaps: (a - b).abs().min((b - c).abs()).min((c - a).abs()) < dead_s,
            time_s: half_s,
        };
        let machine = &mut self.machine;
        if !machine.circuit.sweep(&mut machine.course, &sweep) {
            return false;
        }
        self.guard.sweep(to, dead_s);
        self.paths = [Path::Switch(to); 3];
        self.high = [if rises { 1.0 } else { 0.0 }; 3];
        // A leg that goes low conducts there from its step on; after a sweep to high nobody asks.
        self.low_from_s = at_s.map(|at_s| self.now_s + at_s);
        self.now_s += half_s;
        true
    }

    /// Returns whether each leg's current is expected to flow into the motor at its edge, from its slope without
    /// voltage and what the legs before it take from it.
    #[inline(always)] // in each period
    fn inward(&self, edges_s: [f64; 3], rises: bool) -> [bool; 3] {
        let [a, b, c] = edges_s;
        let since_s = [
            (a - b).max(0.0) + (a - c).max(0.0),
            (b - a).max(0.0) + (b - c).max(0.0),
            (c - a).max(0.0) + (c - b).max(0.0),
        ];
        let circuit = &self.machine.circuit;
        let now = self.machine.now();
        let currents_a = phases(now.stator_a());
        let slopes = phases(circuit.free_slope(now));
        // Half of what a leg's step gives its own current: 2/3 of the supply's voltage over L.
        let taken = circuit.slope_of(if rises { self.bus_v } else { -self.bus_v } / 3.0);
        [0, 1, 2].map(|leg| currents_a[leg] + slopes[leg] * edges_s[leg] > taken * since_s[leg])
    }
}

/// Returns the legs in order of these times.
#[inline(always)] // in each period
fn order([a, b, c]: [f64; 3]) -> [usize; 3] {
    let (first, last) = if a <= b { (0, 1) } else { (1, 0) };
    let (early, late) = (a.min(b), a.max(b));
    if c < early {
        [2, first, last]
    } else if c < late {
        [first, 2, last]
    } else {
        [first, last, 2]
    }
}
