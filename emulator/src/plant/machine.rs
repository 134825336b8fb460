//! The motor on its shaft: the circuit within a period, and the speed from period to period.
//!
//! The speed stands still within a period, at what the last period's torque lets expect of its
//! middle; at the end the period's mean torque moves it (3).

use std::f64::consts::TAU;

use super::circuit::{Circuit, Course, Drive, Moment, Stretch, Sums, Way, confine};
use super::series::{fraction, settle};
use super::vector::{back, phases};
use super::{Load, Motor};

/// Means over a period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flow {
    /// Electromagnetic torque, Nm.
    pub torque_nm: f64,
    /// Square of it.
    pub torque_square: f64,
    /// Electrical power into the motor, W.
    pub motor_w: f64,
    /// Power lost in the windings, W.
    pub copper_w: f64,
    /// Current from the supply, A.
    pub bus_a: f64,
}

/// A motor with its load.
#[derive(Clone, Debug)]
pub(super) struct Machine {
    motor: Motor,
    load: Load,
    inertia_kgm2: f64,
    /// Speed that the shaft is held at whatever the torque, rad/s.
    imposed_rad_s: Option<f64>,
    /// Electrical angle at the start of the period in turns, 0..1.
    angle_turns: f64,
    /// Mechanical speed at the start of the period, rad/s.
    speed_rad_s: f64,
    /// Mechanical acceleration over the last period, rad/s².
    acceleration: f64,
    /// The circuit in this period.
    pub(super) circuit: Circuit,
    /// Where it has come to.
    pub(super) course: Course,
}

impl Machine {
    /// A motor and its load without current, at a mechanical speed and an electrical angle in turns.
    pub(super) fn new(motor: Motor, load: Load, speed_rad_s: f64, angle_turns: f64) -> Self {
        let angle_turns = fraction(angle_turns);
        let (sin, cos) = libm::sincos(TAU * angle_turns);
        Self {
            motor,
            load,
            inertia_kgm2: motor.inertia_kgm2 + load.inertia_kgm2,
            imposed_rad_s: None,
            angle_turns,
            speed_rad_s,
            acceleration: 0.0,
            circuit: Circuit::new(&motor),
            course: Course {
                now: Moment {
                    i: [0.0; 2],
                    direction: [cos, sin],
                },
                sums: Sums::default(),
            },
        }
    }

    /// Holds the shaft at this speed, rad/s, whatever the torque.
    pub(super) fn impose(&mut self, speed_rad_s: f64) {
        self.imposed_rad_s = Some(speed_rad_s);
        self.speed_rad_s = speed_rad_s;
        self.acceleration = 0.0;
    }

    /// Electrical angle at the start of the period in turns, 0..1.
    pub(super) fn angle_turns(&self) -> f64 {
        self.angle_turns
    }

    /// Mechanical speed at the start of the period, rad/s.
    pub(super) fn speed_rad_s(&self) -> f64 {
        self.speed_rad_s
    }

    /// The currents and the rotor's direction now.
    pub(super) fn now(&self) -> &Moment {
        &self.course.now
    }

    /// Currents into the phases, A.
    pub(super) fn currents_a(&self) -> [f64; 3] {
        phases(self.now().stator_a())
    }

    /// Voltages that the rotor induces in the phases, V.
    pub(super) fn emf_v(&self, direction: [f64; 2]) -> [f64; 3] {
        let peak = self.circuit.emf_v;
        phases([-peak * direction[1], peak * direction[0]])
    }

    /// A current that has come to zero with its phase open stays there.
    pub(super) fn open(&mut self, way: Way) {
        let now = &mut self.course.now;
        now.i = back(confine(now.stator_a(), way), now.direction);
    }

    /// Begins a period.
    pub(super) fn begin(&mut self, period_s: f64) {
        let omega = settle(self.middle_rad_s(period_s)) * f64::from(self.motor.pole_pairs);
        self.circuit.turn_at(omega, 0.5 * period_s);
        self.course.sums = Sums::default();
    }

    /// Speed to expect at the middle of the period, rad/s.
    fn middle_rad_s(&self, period_s: f64) -> f64 {
        self.speed_rad_s + 0.5 * period_s * self.acceleration
    }

    /// Takes the currents and the rotor on.
    #[inline(always)]
    pub(super) fn conduct(&mut self, drive: &Drive, stretch: &Stretch) {
        self.circuit.conduct(&mut self.course, drive, stretch);
    }

    /// Ends the period: the shaft takes its mean torque.
    pub(super) fn finish(&mut self, period_s: f64) -> Flow {
        let turns = self.circuit.omega * period_s / TAU;
        self.angle_turns = fraction(self.angle_turns + turns);
        let middle_rad_s = self.middle_rad_s(period_s);
        let Course { now, sums } = &mut self.course;
        let [cos, sin] = now.direction;
        // One Newton step towards length 1 keeps the rounding from adding up.
        let correction = 1.5 - 0.5 * (cos * cos + sin * sin);
        now.direction = [cos * correction, sin * correction];
        now.i = now.i.map(settle);

        let share = 1.0 / period_s;
        let torque_per_a = 1.5 * f64::from(self.motor.pole_pairs) * self.motor.flux_wb;
        let torque_nm = torque_per_a * sums.q * share;
        if self.imposed_rad_s.is_none() {
            // The load by the trapezoidal rule, which is stable however stiff the load.
            let damping = self.load.damping_at(middle_rad_s);
            let inertia = self.inertia_kgm2 + 0.5 * period_s * damping;
            let torque = torque_nm - damping * self.speed_rad_s;
            self.acceleration = torque / inertia;
            self.speed_rad_s = settle(self.speed_rad_s + period_s * self.acceleration);
        }
        Flow {
            torque_nm,
            torque_square: torque_per_a * torque_per_a * sums.squares[1] * share,
            motor_w: 1.5 * self.circuit.inverse_r * sums.energy * share,
            copper_w: 1.5 * self.motor.resistance_ohm * (sums.squares[0] + sums.squares[1]) * share,
            bus_a: self.circuit.inverse_r * sums.charge * share,
        }
    }
}
