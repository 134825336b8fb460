//! The power stage: three legs of switches and diodes between the supply and the motor.
//!
//! With all switches on or a dead time's diode certain, stretches of the closed solution follow
//! each other; everything else is left to the [`diodes`].

mod diodes;

use super::circuit::{Course, Drive, Stretch, Way};
use super::machine::Machine;
use super::vector::{AXES, along_axes, dot};

/// Forward voltage of the switches' body diodes, V: silicon at some amperes. The switches' own
/// resistance counts as part of the motor's.
pub const DIODE_V: f64 = 0.7;

/// Phase current that is none, A.
const ZERO_A: f64 = 1e-10;

/// A pole of the supply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rail {
    Low,
    High,
}

/// What connects a leg's terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Path {
    Switch(Rail),
    Diode(Rail),
    Floating,
}

/// Switches and diodes with the motor behind them.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    pub(super) machine: Machine,
    bus_v: f64,
    paths: [Path; 3],
    /// 1 where a terminal is connected to the positive pole.
    high: [f64; 3],
    /// Diodes' share of a terminal's voltage, V.
    drop_v: [f64; 3],
    /// Legs with both switches off.
    legs_off: u32,
    /// Time since the period's start, s.
    now_s: f64,
    /// Since when a leg's current has been flowing through its low side, s.
    low_from_s: [f64; 3],
}

impl Stage {
    /// All switches off.
    pub(super) fn new(machine: Machine) -> Self {
        Self {
            machine,
            bus_v: 0.0,
            paths: [Path::Floating; 3],
            high: [0.0; 3],
            drop_v: [0.0; 3],
            legs_off: 3,
            now_s: 0.0,
            low_from_s: [f64::NEG_INFINITY; 3],
        }
    }

    /// Begins a period at a supply's voltage.
    pub(super) fn begin(&mut self, bus_v: f64, period_s: f64) {
        self.bus_v = bus_v;
        for from_s in &mut self.low_from_s {
            *from_s -= self.now_s;
        }
        self.now_s = 0.0;
        self.machine.begin(period_s);
    }

    /// The supply's voltage in this period, V.
    pub(super) fn bus_v(&self) -> f64 {
        self.bus_v
    }

    /// Turns one of a leg's switches on, or both off.
    #[inline(always)]
    pub(super) fn set(&mut self, leg: usize, on: Option<Rail>) {
        let was_off = !matches!(self.paths[leg], Path::Switch(_));
        match on {
            Some(rail) => {
                self.legs_off -= u32::from(was_off);
                self.connect(leg, Path::Switch(rail));
            }
            None if !was_off => {
                self.legs_off += 1;
                let current_a = dot(AXES[leg], self.machine.now().stator_a());
                self.connect(
                    leg,
                    if current_a > ZERO_A {
                        Path::Diode(Rail::Low)
                    } else if current_a < -ZERO_A {
                        Path::Diode(Rail::High)
                    } else {
                        Path::Floating
                    },
                );
            }
            None => {}
        }
    }

    /// Lets the stage be for a while.
    pub(super) fn run(&mut self, time_s: f64) {
        if self.legs_off == 0 {
            let drive = self.drive();
            let stretch = self.machine.circuit.stretch(time_s);
            self.machine.conduct(&drive, &stretch);
            self.now_s += time_s;
        } else {
            self.follow(time_s);
        }
    }

    /// Mean voltages of the three terminals in place of switches, V.
    #[inline(always)]
    pub(super) fn run_averaged(&mut self, terminals_v: [f64; 3], stretch: &Stretch) {
        let [alpha, beta] = along_axes(terminals_v);
        // As much power from the supply as into the motor.
        let share = 1.0 / self.bus_v.max(1.0);
        let drive = Drive {
            u: [alpha * (2.0 / 3.0), beta * (2.0 / 3.0)],
            to_bus: [alpha * share, beta * share],
            way: Way::Star,
        };
        self.machine.conduct(&drive, stretch);
        self.now_s += stretch.time_s;
    }

    /// Half a period in which every leg changes once from one rail, where all are, to the other:
    /// edges in order of time, at least a dead time apart.
    ///
    /// In a dead time the diode of one of the rails carries the current on, and all that is special
    /// is its voltage. The circuit is linear: what that does to the currents is added to the
    /// solution without it, at the dead time's end or start, as a kick.
    pub(super) fn sweep(&mut self, to: Rail, edges: [(usize, f64); 3], dead_s: f64, half_s: f64) {
        let circuit = self.machine.circuit;
        // A copy, which can stay in registers.
        let mut course = self.machine.course;
        let certain_a = self.certain_a(dead_s);
        let [last_a, first_a] = circuit.kick_a(2.0 / 3.0 * DIODE_V, dead_s);
        let rises = to == Rail::High;
        let step = if rises { 1.0 } else { -1.0 };
        // Sum of the axes of the legs that are high.
        let mut high = [0.0; 2];
        let (start_s, mut from_s) = (self.now_s, 0.0);
        for (leg, edge_s) in edges {
            let axis = AXES[leg];
            let drive = star(self.bus_v, high, [0.0; 2]);
            // The low diode carries a current into the motor, the high one any other.
            let inward = dot(axis, course.now.stator_a()) > 0.0;
            let stays = inward == rises;
            let to_s = if stays { edge_s + dead_s } else { edge_s };
            let stretch = circuit.stretch(to_s - from_s);
            let solution = circuit.solve(&course.now, &drive, &stretch);
            let current_a = dot(axis, solution.end.stator_a());
            let next = [high[0] + step * axis[0], high[1] + step * axis[1]];
            if current_a.abs() > certain_a && (current_a > 0.0) == inward {
                circuit.follow(&mut course, &drive, &stretch, &solution);
                let (kick_a, missing_s, to_bus) = if stays {
                    (last_a, 0.5 * dead_s, high)
                } else {
                    (first_a, -0.5 * dead_s, next)
                };
                let kick_a = if inward { -kick_a } else { kick_a };
                let kick_a = [kick_a * axis[0], kick_a * axis[1]];
                circuit.kick(&mut course, kick_a, missing_s, to_bus);
                self.paths[leg] = Path::Switch(to);
                self.high[leg] = if rises { 1.0 } else { 0.0 };
                let low_s = if inward { edge_s } else { edge_s + dead_s };
                self.low_from_s[leg] = start_s + low_s;
                from_s = to_s;
            } else {
                self.now_s = start_s + from_s;
                let time_s = edge_s - from_s;
                course = self.change(course, &drive, time_s, (leg, to), dead_s);
                from_s = edge_s + dead_s;
            }
            high = next;
        }
        let drive = star(self.bus_v, high, [0.0; 2]);
        circuit.conduct(&mut course, &drive, &circuit.stretch(half_s - from_s));
        (self.machine.course, self.now_s) = (course, start_s + half_s);
    }

    /// On from somewhere within [`Self::sweep`], through a leg's dead time as its diodes will.
    #[inline(never)]
    fn change(
        &mut self,
        course: Course,
        drive: &Drive,
        time_s: f64,
        (leg, to): (usize, Rail),
        dead_s: f64,
    ) -> Course {
        self.machine.course = course;
        let stretch = self.machine.circuit.stretch(time_s);
        self.machine.conduct(drive, &stretch);
        self.now_s += time_s;
        self.set(leg, None);
        self.follow(dead_s);
        self.set(leg, Some(to));
        self.machine.course
    }

    /// The phase current that cannot come to zero within this time, A.
    fn certain_a(&self, time_s: f64) -> f64 {
        // The longest vector, with every diode's drop added; the current's own growth within a
        // period moves the bound by less than the tenth on top.
        let longest_v = 2.0 / 3.0 * (self.bus_v + 2.0 * DIODE_V);
        1.1 * time_s
            * self
                .machine
                .circuit
                .slope_bound(self.machine.now(), longest_v)
    }

    /// For how long each leg's current has been flowing through its low side, s; `None` where it
    /// does not.
    pub(super) fn low_s(&self) -> [Option<f64>; 3] {
        [0, 1, 2].map(|leg| match self.paths[leg] {
            Path::Switch(Rail::Low) | Path::Diode(Rail::Low) => {
                Some(self.now_s - self.low_from_s[leg])
            }
            _ => None,
        })
    }

    /// Voltages of the terminals against the negative pole, V.
    pub(super) fn terminals_v(&self) -> [f64; 3] {
        let emf = self.machine.emf_v(self.machine.now().direction);
        let star_v = match self.way() {
            Way::Star => 0.0,
            Way::Without(leg) => 0.5 * (self.sum_v() + emf[leg]),
            Way::Nowhere => match self.only() {
                Some(leg) => self.leg_v(leg) - emf[leg],
                // The dividers pull the star to ground, unless a low diode holds the lowest there.
                None => (-DIODE_V - emf[0].min(emf[1]).min(emf[2])).max(0.0),
            },
        };
        [0, 1, 2].map(|leg| match self.paths[leg] {
            Path::Floating => star_v + emf[leg],
            _ => self.leg_v(leg),
        })
    }

    fn connect(&mut self, leg: usize, path: Path) {
        let low = |path| matches!(path, Path::Switch(Rail::Low) | Path::Diode(Rail::Low));
        if low(path) && !low(self.paths[leg]) {
            self.low_from_s[leg] = self.now_s;
        }
        self.paths[leg] = path;
        (self.high[leg], self.drop_v[leg]) = match path {
            Path::Switch(Rail::Low) | Path::Floating => (0.0, 0.0),
            Path::Switch(Rail::High) => (1.0, 0.0),
            Path::Diode(Rail::Low) => (0.0, -DIODE_V),
            Path::Diode(Rail::High) => (1.0, DIODE_V),
        };
    }

    fn leg_v(&self, leg: usize) -> f64 {
        self.bus_v * self.high[leg] + self.drop_v[leg]
    }

    /// Sum of the connected terminals' voltages, V.
    fn sum_v(&self) -> f64 {
        self.leg_v(0) + self.leg_v(1) + self.leg_v(2)
    }

    /// The one leg that is connected.
    fn only(&self) -> Option<usize> {
        (0..3).find(|leg| self.paths[*leg] != Path::Floating)
    }

    fn way(&self) -> Way {
        let floats = self.paths.map(|path| path == Path::Floating);
        match floats {
            [false, false, false] => Way::Star,
            [true, false, false] => Way::Without(0),
            [false, true, false] => Way::Without(1),
            [false, false, true] => Way::Without(2),
            _ => Way::Nowhere,
        }
    }

    /// What three connected legs do to the motor.
    fn drive(&self) -> Drive {
        star(self.bus_v, along_axes(self.high), along_axes(self.drop_v))
    }
}

/// All phases conduct: by the sum of the axes of those at the positive pole, and the diodes' share
/// of the voltages as such a sum.
#[inline(always)]
fn star(bus_v: f64, high: [f64; 2], drop_v: [f64; 2]) -> Drive {
    Drive {
        u: [
            (bus_v * high[0] + drop_v[0]) * (2.0 / 3.0),
            (bus_v * high[1] + drop_v[1]) * (2.0 / 3.0),
        ],
        to_bus: high,
        way: Way::Star,
    }
}
