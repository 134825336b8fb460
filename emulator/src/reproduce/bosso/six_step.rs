//! The paper's BLDC control of section III: in each sextant one leg switches at a constant duty,
//! one is held low and one is off (footnote 1). It commutates at the exact angle, wherever in a PWM
//! period that falls; there is no current loop.

use siskin_control::control::six_step::commutation::{Legs as Roles, Sector};

use super::course::{Course, Legs};
use super::means::{Means, seek};
use super::setting::{BUS_V, CARRIER_HZ, MOTOR, PHASES, electrical_hz};
use crate::plant::Rail;

/// Time after which electrical transients are over, 70 times L/R, s.
const SETTLE_S: f64 = 0.02;

/// Angle at which the first sextant begins, turns.
const FIRST_TURNS: f64 = -0.25;

/// Mean back-EMF between two phases within a sextant over a phase's peak: √3·3/π.
const BETWEEN_PHASES: f64 = 1.653_986_686_265_375_8;

/// A constant speed and duty.
#[derive(Clone, Copy, Debug)]
pub(super) struct SixStep {
    /// Mechanical speed, rpm.
    pub(super) rpm: f64,
    /// Share of the carrier period for which the switching leg is high.
    pub(super) duty: f64,
    /// Time for which both of a leg's switches are off between its states, s.
    pub(super) dead_time_s: f64,
}

impl SixStep {
    /// Returns a first guess: the duty at which the back-EMF leaves a current through two phases
    /// for this torque, without commutation.
    pub(super) fn near(rpm: f64, torque_nm: f64) -> Self {
        let emf_v = std::f64::consts::TAU * electrical_hz(rpm) * MOTOR.flux_wb;
        // The power into a constant current between two phases: T·ω_m is e·i.
        let per_a = BETWEEN_PHASES * f64::from(MOTOR.pole_pairs) * MOTOR.flux_wb;
        let drop_v = 2.0 * MOTOR.resistance_ohm * torque_nm / per_a;
        Self {
            rpm,
            duty: ((BETWEEN_PHASES * emf_v + drop_v) / BUS_V).clamp(0.0, 1.0),
            dead_time_s: 0.0,
        }
    }

    /// Finds the duty that gives the wanted mean torque, by the secant from [`Self::near`].
    pub(super) fn at_torque(rpm: f64, torque_nm: f64, dead_time_s: f64, time_s: f64) -> Self {
        let with = |duty: f64| Self {
            rpm,
            duty,
            dead_time_s,
        };
        let near = Self::near(rpm, torque_nm).duty.min(0.98);
        let torque = |duty: f64| with(duty.clamp(0.0, 1.0)).measure(time_s).torque_nm();
        with(seek(torque_nm, [near, near + 0.01], torque).clamp(0.0, 1.0))
    }

    /// Measures for a total time, in equal parts from several phases of the carrier against the
    /// rotor: if their frequencies are in a ratio of small integers the phase does not drift.
    pub(super) fn measure(&self, time_s: f64) -> Means {
        let part_s = time_s / f64::from(PHASES);
        let parts = (0..PHASES).map(|part| {
            let mut drive = Drive::new(self, f64::from(part) / f64::from(PHASES));
            drive.run_until(SETTLE_S);
            drive.course.measure();
            drive.run_until(SETTLE_S + part_s);
            drive.course.means
        });
        parts.fold(Means::default(), |all, part| all.join(&part))
    }

    /// Returns the torque over a time, as s since its start and Nm.
    pub(super) fn waveform(&self, time_s: f64) -> Vec<(f64, f64)> {
        let mut drive = Drive::new(self, 0.0);
        drive.run_until(SETTLE_S);
        drive.course.draw();
        drive.run_until(SETTLE_S + time_s);
        drive.course.waveform
    }
}

/// A run of the drive.
struct Drive<'a> {
    setting: &'a SixStep,
    course: Course,
    now_s: f64,
    /// Phase of the carrier at time 0, as a share of its period.
    carrier: f64,
    /// Edges of the switching leg so far: every other one rises.
    edges: u32,
    /// Commutations so far.
    commutations: u32,
    sector: Sector,
    /// The wanted leg states.
    wanted: Legs,
    /// When each leg may change, s.
    on_from_s: [f64; 3],
}

impl<'a> Drive<'a> {
    /// Starts at the beginning of the first sextant, without current.
    fn new(setting: &'a SixStep, carrier: f64) -> Self {
        let mut drive = Self {
            setting,
            course: Course::new(setting.rpm, FIRST_TURNS),
            now_s: 0.0,
            carrier,
            edges: 0,
            commutations: 0,
            sector: Sector::Ac,
            wanted: [None; 3],
            on_from_s: [0.0; 3],
        };
        while drive.edge_s() <= 0.0 {
            drive.edges += 1;
        }
        drive.want();
        drive
    }

    /// Returns when the switching leg changes next: it is high about the middle of the carrier
    /// period.
    fn edge_s(&self) -> f64 {
        let period = f64::from(self.edges / 2) + 0.5 - self.carrier;
        let half_duty = 0.5 * self.setting.duty;
        let rises = self.edges.is_multiple_of(2);
        let periods = period + if rises { -half_duty } else { half_duty };
        periods / CARRIER_HZ
    }

    /// Returns when the sextant ends.
    fn commutation_s(&self) -> f64 {
        f64::from(self.commutations + 1) / (6.0 * electrical_hz(self.setting.rpm))
    }

    fn run_until(&mut self, end_s: f64) {
        while self.now_s < end_s {
            let (edge_s, commutation_s) = (self.edge_s(), self.commutation_s());
            let mut next_s = edge_s.min(commutation_s).min(end_s);
            for on_s in self.on_from_s {
                if on_s > self.now_s {
                    next_s = next_s.min(on_s);
                }
            }
            let legs = [0, 1, 2].map(|leg| {
                let on = self.on_from_s[leg] <= self.now_s;
                self.wanted[leg].filter(|_| on)
            });
            self.course.run(legs, next_s - self.now_s);
            self.now_s = next_s;
            if edge_s <= next_s {
                self.edges += 1;
            }
            if commutation_s <= next_s {
                self.commutations += 1;
                self.sector = self.sector.next();
            }
            self.want();
        }
    }

    /// Notes the wanted leg states. A leg that changes rails waits for the dead time.
    fn want(&mut self) {
        let high = !self.edges.is_multiple_of(2);
        let wanted = self.sector.phases(Roles {
            switching: Some(if high { Rail::High } else { Rail::Low }),
            low: Some(Rail::Low),
            floating: None,
        });
        let legs = wanted.iter().zip(&self.wanted).zip(&mut self.on_from_s);
        for ((next, before), on_from_s) in legs {
            if next != before && next.is_some() && before.is_some() {
                *on_from_s = self.now_s + self.setting.dead_time_s;
            }
        }
        self.wanted = wanted;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// So slow that a sextant is many time constants, and the current is V·d − e over 2R for nearly
    /// all of it.
    #[test]
    fn a_slow_motor_takes_what_the_two_phases_leave() {
        let torque_nm = 0.1;
        let drive = SixStep::near(60.0, torque_nm);
        let got = drive.measure(0.5).torque_nm();
        assert!((got / torque_nm - 1.0).abs() < 0.02, "{got}");
    }

    #[test]
    fn the_duty_is_found_for_a_torque() {
        for dead_time_s in [0.0, 500e-9] {
            let drive = SixStep::at_torque(4500.0, 0.0972, dead_time_s, 0.02);
            let got = drive.measure(0.02).torque_nm();
            // With a dead time the current's zero crossings put steps into the torque over the
            // duty.
            assert!((got - 0.0972).abs() < 1e-4, "{got}");
        }
    }
}
