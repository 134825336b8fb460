//! The power stage: three legs of switches and diodes between the supply and the motor.
//!
//! With all switches on, or a dead time's diode certain, stretches of the closed solution follow one another;
//! everything else is left to the [`diodes`].

mod broken;
mod diodes;
mod guard;
mod sweep;

use super::breaks::Breaks;
use super::circuit::{Drive, Way};
use super::machine::Machine;
use super::rail::Rail;
use super::vector::{AXES, along_axes, dot};
use guard::Guard;

/// Forward voltage of the switches' body diodes, V: silicon at some amperes. The switches' own resistance counts as
/// part of the motor's.
pub const DIODE_V: f64 = 0.7;

/// Phase current that counts as zero, A.
const ZERO_A: f64 = 1e-10;

/// What connects a leg's terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Path {
    Switch(Rail),
    Diode(Rail),
    Floating,
    /// Both switches: a shoot-through.
    Both,
    /// No path: the wire is open.
    Cut,
}

impl Path {
    /// Returns true if a current flows through the low side and its shunt.
    fn is_low(self) -> bool {
        matches!(
            self,
            Self::Switch(Rail::Low) | Self::Diode(Rail::Low) | Self::Both
        )
    }

    /// Returns true if no current can flow.
    fn is_open(self) -> bool {
        matches!(self, Self::Floating | Self::Cut)
    }
}

/// Switches and diodes with the motor behind them.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    pub(super) machine: Machine,
    bus_v: f64,
    paths: [Path; 3],
    /// 1 if a terminal is connected to the positive pole.
    high: [f64; 3],
    /// The diodes' share of a terminal's voltage, V.
    drop_v: [f64; 3],
    /// Legs with both switches off.
    legs_off: u32,
    /// Time since the period's start, s.
    now_s: f64,
    /// Since when a leg's current has been flowing through its low side, s.
    low_from_s: [f64; 3],
    /// True if nothing is broken.
    sound: bool,
    breaks: Breaks,
    /// Shoot-through charge in this period, As.
    shot_as: f64,
    guard: Guard,
}

impl Stage {
    /// Creates a stage with all switches off.
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
            sound: true,
            breaks: Breaks::default(),
            shot_as: 0.0,
            guard: Guard::new(),
        }
    }

    /// Begins a period at a supply voltage, in which there must be `dead_s` between the switches of a leg.
    #[inline(always)] // in each period
    pub(super) fn begin(&mut self, bus_v: f64, period_s: f64, dead_s: f64) {
        self.bus_v = bus_v;
        self.guard.begin(dead_s, self.now_s);
        for from_s in &mut self.low_from_s {
            *from_s -= self.now_s;
        }
        self.now_s = 0.0;
        self.shot_as = 0.0;
        self.machine.begin(period_s);
    }

    /// Returns the supply's voltage in this period, V.
    pub(super) fn bus_v(&self) -> f64 {
        self.bus_v
    }

    /// Returns a leg that had less than the dead time between its switches in this period.
    pub(super) fn crossed(&self) -> Option<usize> {
        self.guard.crossed()
    }

    /// Turns one of a leg's switches on, or both off.
    #[inline(always)] // in each period
    pub(super) fn set(&mut self, leg: usize, on: Option<Rail>) {
        self.guard.turn(leg, on, self.now_s);
        self.switch(leg, on);
    }

    /// Puts the legs at a rail, as if for long.
    #[cold]
    pub(super) fn hold(&mut self, rail: Rail) {
        self.guard.hold(rail);
        for leg in 0..3 {
            self.switch(leg, Some(rail));
        }
    }

    #[inline(always)] // in each period
    fn switch(&mut self, leg: usize, on: Option<Rail>) {
        if !self.sound {
            return self.set_broken(leg, on);
        }
        let was_off = !matches!(self.paths[leg], Path::Switch(_));
        match on {
            Some(rail) => {
                self.legs_off -= u32::from(was_off);
                self.connect(leg, Path::Switch(rail));
            }
            None if !was_off => {
                self.legs_off += 1;
                self.connect(leg, self.diode(leg));
            }
            None => {}
        }
    }

    /// Returns what carries a leg's current with both switches off.
    #[inline(always)] // in each period
    fn diode(&self, leg: usize) -> Path {
        let current_a = dot(AXES[leg], self.machine.now().stator_a());
        if current_a > ZERO_A {
            Path::Diode(Rail::Low)
        } else if current_a < -ZERO_A {
            Path::Diode(Rail::High)
        } else {
            Path::Floating
        }
    }

    /// Runs the stage unchanged for a time.
    pub(super) fn run(&mut self, time_s: f64) {
        if !self.sound {
            self.shoot(time_s);
        }
        if self.legs_off == 0 {
            let drive = self.drive();
            let stretch = self.machine.circuit.stretch(time_s);
            self.machine.conduct(&drive, &stretch);
            self.now_s += time_s;
        } else {
            self.follow(time_s);
        }
    }

    /// Runs on mean voltages of the three terminals in place of switches, V.
    #[inline(always)] // in each period
    pub(super) fn run_averaged(&mut self, terminals_v: [f64; 3], time_s: f64) {
        let [alpha, beta] = along_axes(terminals_v);
        let u = [alpha * (2.0 / 3.0), beta * (2.0 / 3.0)];
        self.machine.conduct_mean(u, self.bus_v, time_s);
        self.now_s += time_s;
    }

    /// Returns how long each leg's current has been flowing through its low side, s; `None` if it does not.
    #[inline(always)] // in each period
    pub(super) fn low_s(&self) -> [Option<f64>; 3] {
        [0, 1, 2].map(|leg| match self.paths[leg] {
            path if path.is_low() => Some(self.now_s - self.low_from_s[leg]),
            _ => None,
        })
    }

    /// Returns the terminals' voltages against the negative pole, V.
    #[inline(always)] // in each period
    pub(super) fn terminals_v(&self) -> [f64; 3] {
        if self.legs_off == 0 {
            return [0, 1, 2].map(|leg| self.leg_v(leg));
        }
        self.open_terminals_v()
    }

    /// Returns the same with a leg off.
    fn open_terminals_v(&self) -> [f64; 3] {
        let drive = self.confined();
        let emf = self.machine.emf_v(self.machine.now(), &drive);
        let star_v = match drive.way {
            Way::Star => 0.0,
            Way::Without(leg) => 0.5 * (self.sum_v() + emf[leg]),
            Way::Nowhere => match self.only() {
                Some(leg) => self.leg_v(leg) - emf[leg],
                // The dividers pull the star to ground, unless a low diode holds the lowest there.
                None => (-DIODE_V - self.lowest_v(emf)).max(0.0),
            },
        };
        [0, 1, 2].map(|leg| match self.paths[leg] {
            Path::Floating => star_v + emf[leg],
            // The board's end of the wire.
            Path::Cut => 0.0,
            _ => self.leg_v(leg),
        })
    }

    /// Returns the lowest of the voltages induced in phases with a wire, V.
    fn lowest_v(&self, emf_v: [f64; 3]) -> f64 {
        let legs = (0..3).filter(|leg| self.paths[*leg] != Path::Cut);
        legs.fold(f64::INFINITY, |lowest, leg| lowest.min(emf_v[leg]))
    }

    fn connect(&mut self, leg: usize, path: Path) {
        if path.is_low() && !self.paths[leg].is_low() {
            self.low_from_s[leg] = self.now_s;
        }
        self.paths[leg] = path;
        (self.high[leg], self.drop_v[leg]) = match path {
            Path::Switch(Rail::Low) | Path::Floating | Path::Cut => (0.0, 0.0),
            Path::Both => (0.5, 0.0),
            Path::Switch(Rail::High) => (1.0, 0.0),
            Path::Diode(Rail::Low) => (0.0, -DIODE_V),
            Path::Diode(Rail::High) => (1.0, DIODE_V),
        };
    }

    fn leg_v(&self, leg: usize) -> f64 {
        self.bus_v * self.high[leg] + self.drop_v[leg]
    }

    /// Returns the sum of the connected terminals' voltages, V.
    fn sum_v(&self) -> f64 {
        self.leg_v(0) + self.leg_v(1) + self.leg_v(2)
    }

    /// Returns the only connected leg.
    fn only(&self) -> Option<usize> {
        (0..3).find(|leg| !self.paths[*leg].is_open())
    }

    fn way(&self) -> Way {
        match self.paths.map(Path::is_open) {
            [false, false, false] => Way::Star,
            [true, false, false] => Way::Without(0),
            [false, true, false] => Way::Without(1),
            [false, false, true] => Way::Without(2),
            _ => Way::Nowhere,
        }
    }

    /// Returns what the legs apply to the motor, and which currents they let flow.
    fn confined(&self) -> Drive {
        Drive {
            way: self.way(),
            ..self.drive()
        }
    }

    /// Returns what three connected legs apply to the motor.
    fn drive(&self) -> Drive {
        star(self.bus_v, along_axes(self.high), along_axes(self.drop_v))
    }
}

/// Returns the drive of all phases conducting, from the sum of the axes of those at the positive pole, and the diodes'
/// share of the voltages as such a sum.
#[inline(always)] // in each period
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
