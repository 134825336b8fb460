//! Legs whose switches are both off.
//!
//! Such a leg conducts through the diode set by its current's sign until the current is zero; then it floats until the
//! voltage at its terminal would forward-bias a diode. The instants of these events are found on the closed solution.

use super::super::circuit::{Drive, Moment, Way};
use super::super::series::root;
use super::super::vector::phases;
use super::{DIODE_V, Path, Rail, Stage, ZERO_A};

/// Forward bias above which a floating leg's diode conducts, V: far above rounding and far below what moves a current.
const ONSET_V: f64 = 1e-6;

/// Accuracy of a voltage's zero, V; that of a current's is [`ZERO_A`].
const ZERO_V: f64 = 0.5e-6;

/// Electrical angle within which a current or voltage is assumed to cross its limit at most once, rad: an excursion
/// between two looks stays below ωφ/8·0.05² of voltage, 3 mV at 6000 rpm.
const LOOK_RAD: f64 = 0.05;

/// Two zero-crossings closer than this count as one, s: the current then does not return.
const INSTANT_S: f64 = 1e-12;

/// The leg closest to conducting.
struct Onset {
    /// Voltage beyond that of its diode, V.
    excess_v: f64,
    /// Legs that begin to conduct, and to which rail; both the same if there is only one.
    legs: [(usize, Rail); 2],
}

impl Stage {
    /// Follows the diodes from event to event.
    pub(super) fn follow(&mut self, time_s: f64) {
        let look_s = LOOK_RAD / self.machine.fastest_rad_s();
        let mut left_s = time_s;
        let mut resolve = true;
        while left_s > 0.0 {
            if resolve {
                self.resolve();
            }
            let drive = self.confined();
            if drive.way == Way::Nowhere && self.idle() {
                let stretch = self.machine.circuit.stretch(left_s);
                self.machine.conduct(&drive, &stretch);
                self.now_s += left_s;
                return;
            }
            let step_s = left_s.min(look_s);
            let (at_s, stopped) = self.next_event(&drive, step_s);
            let stretch = self.machine.circuit.stretch(at_s);
            self.machine.conduct(&drive, &stretch);
            self.now_s += at_s;
            left_s -= at_s;
            if let Some(leg) = stopped {
                self.connect(leg, Path::Floating);
                self.still();
            }
            resolve = at_s > INSTANT_S;
        }
    }

    /// Returns true if the rotor is too slow to conduct by itself, with all legs off.
    fn idle(&self) -> bool {
        self.only().is_none() && self.machine.line_v() < self.bus_v + 2.0 * DIODE_V
    }

    /// Returns the first event within a time, or its end, and the leg whose current reaches zero there.
    fn next_event(&self, drive: &Drive, step_s: f64) -> (f64, Option<usize>) {
        let machine = &self.machine;
        let at = |t| machine.after(drive, t);
        let end = at(step_s);
        let mut at_s = step_s;
        let mut stopped = None;
        for leg in 0..3 {
            let sign = match self.paths[leg] {
                Path::Diode(Rail::Low) => 1.0,
                Path::Diode(Rail::High) => -1.0,
                _ => continue,
            };
            let forward_a = |at: &Moment| sign * phases(at.stator_a())[leg];
            let (first, last) = (forward_a(machine.now()), forward_a(&end));
            if last >= 0.0 {
                continue;
            }
            let zero_s = if first <= 0.0 {
                0.0
            } else {
                let f = |t| forward_a(&at(t));
                root(f, first, last, step_s, ZERO_A)
            };
            if zero_s < at_s {
                (at_s, stopped) = (zero_s, Some(leg));
            }
        }
        if drive.way != Way::Star {
            // Just beyond the onset, so that the leg does conduct then.
            let beyond_v = |at: &Moment| self.onset(at, drive).excess_v - 2.0 * ONSET_V;
            let (first, last) = (beyond_v(machine.now()), beyond_v(&end));
            if first < 0.0 && last > ZERO_V {
                let f = |t| beyond_v(&at(t));
                let onset_s = root(f, first, last, step_s, ZERO_V);
                if onset_s < at_s {
                    (at_s, stopped) = (onset_s, None);
                }
            }
        }
        (at_s, stopped)
    }

    /// Lets floating legs conduct if their diodes are forward-biased.
    fn resolve(&mut self) {
        for _ in 0..3 {
            let drive = self.confined();
            if drive.way == Way::Star {
                return;
            }
            let onset = self.onset(self.machine.now(), &drive);
            if onset.excess_v < ONSET_V {
                return;
            }
            for (leg, rail) in onset.legs {
                self.connect(leg, Path::Diode(rail));
            }
        }
    }

    /// Stops currents: with fewer than two legs connected none flows, and no diode stays conducting; nor does one of
    /// two legs that have reached zero together with the third.
    fn still(&mut self) {
        self.machine.open(self.way());
        let currents_a = phases(self.machine.now().stator_a());
        let nowhere = self.way() == Way::Nowhere;
        for (leg, current_a) in currents_a.into_iter().enumerate() {
            let idle = nowhere || current_a.abs() <= ZERO_A;
            if idle && matches!(self.paths[leg], Path::Diode(_)) {
                self.connect(leg, Path::Floating);
            }
        }
        self.machine.open(self.way());
    }

    /// Returns the legs with the highest and the lowest induced voltage.
    fn extremes(&self, emf_v: [f64; 3]) -> (usize, usize) {
        let wired = |leg: usize| self.paths[leg] != Path::Cut;
        let better = |leg, best, than: fn(&f64, &f64) -> bool| {
            wired(leg) && (!wired(best) || than(&emf_v[leg], &emf_v[best]))
        };
        let (mut highest, mut lowest) = (0, 0);
        for leg in 1..3 {
            if better(leg, highest, f64::gt) {
                highest = leg;
            }
            if better(leg, lowest, f64::lt) {
                lowest = leg;
            }
        }
        (highest, lowest)
    }

    /// Returns how far the floating legs' voltages are beyond the diodes' at some time.
    fn onset(&self, at: &Moment, drive: &Drive) -> Onset {
        let emf = self.machine.emf_v(at, drive);
        let high_v = self.bus_v + DIODE_V;
        let star_v = match (drive.way, self.only()) {
            (Way::Nowhere, None) => {
                let (highest, lowest) = self.extremes(emf);
                return Onset {
                    excess_v: emf[highest] - emf[lowest] - high_v - DIODE_V,
                    legs: [(highest, Rail::High), (lowest, Rail::Low)],
                };
            }
            (Way::Nowhere, Some(leg)) => self.leg_v(leg) - emf[leg],
            (Way::Without(leg), _) => 0.5 * (self.sum_v() + emf[leg]),
            (Way::Star, _) => 0.0,
        };
        let mut onset = Onset {
            excess_v: f64::NEG_INFINITY,
            legs: [(0, Rail::Low); 2],
        };
        for (leg, emf_v) in emf.into_iter().enumerate() {
            if self.paths[leg] != Path::Floating {
                continue;
            }
            let leg_v = star_v + emf_v;
            let (excess_v, rail) = if leg_v - high_v > -DIODE_V - leg_v {
                (leg_v - high_v, Rail::High)
            } else {
                (-DIODE_V - leg_v, Rail::Low)
            };
            if excess_v > onset.excess_v {
                onset = Onset {
                    excess_v,
                    legs: [(leg, rail); 2],
                };
            }
        }
        onset
    }
}
