//! A stage with something broken in it: wires, and switches that no longer follow the timer.
//!
//! - An open wire takes its phase's current to zero at once, as an arc would within microseconds; no diode carries it
//!   on, and the board's end of it reads as ground. What its leg's switches then do shows nowhere: a shoot-through in
//!   that leg is left out.
//! - An open switch never turns on; its body diode is sound.
//! - A shorted switch is always on. With the other one on as well, the leg is a divider of two equal resistances: half
//!   the supply's voltage for the motor and, through both switches and the shunt, V/(2·R_on) besides what the motor
//!   takes.

use super::super::breaks::Breaks;
use super::super::gates::Gate;
use super::super::rail::Rail;
use super::super::vector::{AXES, dot};
use super::{Path, Stage};

/// Resistance of one switch with its half of the leg's copper and shunt, Ω: 2 mΩ of silicon, 3 mΩ of shunt and some
/// copper share the leg.
const ON_OHM: f64 = 3e-3;

impl Stage {
    /// Returns true if nothing is broken.
    #[inline(always)] // in each period
    pub(in super::super) fn is_sound(&self) -> bool {
        self.sound
    }

    /// Returns true if a switch is always on.
    pub(in super::super) fn is_shorted(&self) -> bool {
        self.breaks.0.iter().any(|leg| leg.shorted.contains(&true))
    }

    /// Breaks these parts and mends all others, while the timer has these switches on.
    pub(in super::super) fn break_legs(&mut self, breaks: &Breaks, on: [Option<Rail>; 3]) {
        self.breaks = *breaks;
        self.sound = *breaks == Breaks::default();
        for leg in 0..3 {
            if breaks.0[leg].wire {
                self.rewire(leg, Path::Cut);
            }
        }
        self.machine.open(self.way());
        for (leg, on) in on.into_iter().enumerate() {
            self.set_broken(leg, on);
        }
    }

    /// Does what [`Stage::set`] does when something is broken, or has just been mended.
    #[cold]
    pub(super) fn set_broken(&mut self, leg: usize, on: Option<Rail>) {
        self.connect_broken(leg, [Rail::Low, Rail::High].map(|rail| on == Some(rail)));
    }

    /// Connects a leg from the state of its gates, low and high.
    fn connect_broken(&mut self, leg: usize, on: [bool; 2]) {
        let breaks = self.breaks.0[leg];
        let closed = |rail: Rail| {
            let index = rail as usize;
            breaks.shorted[index] || (on[index] && !breaks.open[index])
        };
        let path = match (closed(Rail::Low), closed(Rail::High)) {
            _ if breaks.wire => Path::Cut,
            (true, true) => Path::Both,
            (true, false) => Path::Switch(Rail::Low),
            (false, true) => Path::Switch(Rail::High),
            (false, false) => self.diode(leg),
        };
        self.rewire(leg, path);
    }

    /// Turns a leg's gates on or off; both on is a shoot-through.
    #[inline(always)] // in each period
    pub(in super::super) fn set_gates(&mut self, leg: usize, gate: Gate) {
        if self.sound && !gate.shoots() {
            self.set(leg, gate.on());
        } else {
            self.set_unsound(leg, gate);
        }
    }

    /// See [`Stage::set_gates`]. A leg that shoots through makes the stage unsound as long as it does.
    #[cold]
    fn set_unsound(&mut self, leg: usize, gate: Gate) {
        self.connect_broken(leg, [gate.low, gate.high]);
        self.sound = self.breaks == Breaks::default() && !self.paths.contains(&Path::Both);
    }

    fn rewire(&mut self, leg: usize, path: Path) {
        let on = |path| matches!(path, Path::Switch(_) | Path::Both);
        self.legs_off += u32::from(on(self.paths[leg]));
        self.legs_off -= u32::from(on(path));
        self.connect(leg, path);
    }

    /// Lets shoot-throughs flow for a time.
    #[cold]
    pub(super) fn shoot(&mut self, time_s: f64) {
        let legs = self.paths.iter().filter(|path| **path == Path::Both);
        self.shot_as += legs.count() as f64 * time_s * self.shoot_a();
    }

    /// Returns the charge that has bypassed the motor from pole to pole in this period, As.
    pub(in super::super) fn shot_as(&self) -> f64 {
        self.shot_as
    }

    /// Returns the current from pole to pole through a leg with both switches on, A.
    fn shoot_a(&self) -> f64 {
        self.bus_v / (2.0 * ON_OHM)
    }

    /// Returns the currents of the low sides' shunts into the phases, A.
    pub(in super::super) fn shunts_a(&self) -> [f64; 3] {
        let stator_a = self.machine.now().stator_a();
        [0, 1, 2].map(|leg| {
            let phase_a = dot(AXES[leg], stator_a);
            match self.paths[leg] {
                Path::Both => 0.5 * phase_a - self.shoot_a(),
                path if path.is_low() => phase_a,
                _ => 0.0,
            }
        })
    }
}
