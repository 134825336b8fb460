//! The motor under the mean voltage of each half period, integrated exactly.
//!
//! With the bridge off the currents die and stay at zero: what a motor that turns faster than its
//! supply's voltage would drive back through the diodes is left out.
//!
//! Between two changes of voltage the currents in the stator's frame obey a linear equation with
//! a constant and a rotating input, which has a closed solution while the speed is constant (1),
//! (2). The speed is advanced in two halves around it, by the torque before and after (3).

use std::f64::consts::TAU;

use siskin_control::drive::Bridge;

use super::{Load, Motor};

/// What the inverter does for a while.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// All switches off: the currents die against the supply.
    Off,
    /// Voltages of the phases against the supply's negative pole, V.
    Phases([f64; 3]),
}

/// Means over a stretch of time.
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
}

impl Flow {
    /// The mean of two stretches of equal length.
    pub fn mean(&self, other: &Self) -> Self {
        Self {
            torque_nm: 0.5 * (self.torque_nm + other.torque_nm),
            torque_square: 0.5 * (self.torque_square + other.torque_square),
            motor_w: 0.5 * (self.motor_w + other.motor_w),
            copper_w: 0.5 * (self.copper_w + other.copper_w),
        }
    }
}

/// The motor's state and its surroundings.
#[derive(Clone, Debug)]
pub struct Averaged {
    motor: Motor,
    load: Load,
    inertia_kgm2: f64,
    /// Speed that the shaft is held at whatever the torque, rad/s.
    imposed_rad_s: Option<f64>,
    /// Phase current vector in the stator's frame, A.
    i: [f64; 2],
    /// Electrical angle in turns, 0..1.
    angle_turns: f64,
    /// Cosine and sine of the angle.
    direction: [f64; 2],
    /// Mechanical speed, rad/s.
    speed_rad_s: f64,
    /// e^(−R·h/L) and the h that it is of.
    decay: (f64, f64),
}

impl Averaged {
    /// A motor and its load, at a mechanical speed and an electrical angle in turns.
    pub fn new(motor: Motor, load: Load, speed_rad_s: f64, angle_turns: f64) -> Self {
        let angle_turns = fraction(angle_turns);
        let (sin, cos) = libm::sincos(TAU * angle_turns);
        Self {
            motor,
            load,
            inertia_kgm2: motor.inertia_kgm2 + load.inertia_kgm2,
            imposed_rad_s: None,
            i: [0.0; 2],
            angle_turns,
            direction: [cos, sin],
            speed_rad_s,
            decay: (0.0, 1.0),
        }
    }

    /// Holds the shaft at this speed, rad/s, whatever the torque.
    pub fn impose(&mut self, speed_rad_s: f64) {
        self.imposed_rad_s = Some(speed_rad_s);
        self.speed_rad_s = speed_rad_s;
    }

    /// Electrical angle in turns, 0..1.
    pub fn angle_turns(&self) -> f64 {
        self.angle_turns
    }

    /// Mechanical speed, rad/s.
    pub fn speed_rad_s(&self) -> f64 {
        self.speed_rad_s
    }

    /// Currents into the phases, A.
    pub fn currents_a(&self) -> [f64; 3] {
        let [alpha, beta] = self.i;
        let half_root_3_beta = HALF_ROOT_3 * beta;
        [
            alpha,
            half_root_3_beta - 0.5 * alpha,
            -half_root_3_beta - 0.5 * alpha,
        ]
    }

    /// Current along and across the rotor's flux, A.
    pub fn current_dq_a(&self) -> [f64; 2] {
        let ([alpha, beta], [cos, sin]) = (self.i, self.direction);
        [alpha * cos + beta * sin, beta * cos - alpha * sin]
    }

    /// Electromagnetic torque (3), Nm.
    pub fn torque_nm(&self) -> f64 {
        1.5 * f64::from(self.motor.pole_pairs) * self.motor.flux_wb * self.current_dq_a()[1]
    }

    /// Takes the motor on by `time_s` and returns the means over that time.
    ///
    /// `bus_v` is what dying currents work against.
    pub fn advance(&mut self, drive: Drive, bus_v: f64, time_s: f64) -> Flow {
        let before = self.power(drive);
        self.accelerate(0.5 * time_s);
        match drive {
            Drive::Off => self.freewheel(bus_v, time_s),
            Drive::Phases(phases) => self.conduct(vector(phases), time_s),
        }
        self.accelerate(0.5 * time_s);
        let after = self.power(drive);
        before.mean(&after)
    }

    /// The closed solution under a constant voltage vector at a constant speed: the transient dies
    /// towards u/R − jωφ·e^(jθ)/(R + jωL), which turns with the rotor.
    fn conduct(&mut self, u: [f64; 2], time_s: f64) {
        if self.decay.0 != time_s {
            let exponent = -self.motor.resistance_ohm / self.motor.inductance_h * time_s;
            self.decay = (time_s, libm::exp(exponent));
        }
        let r = self.motor.resistance_ohm;
        let omega = self.speed_rad_s * f64::from(self.motor.pole_pairs);
        let x = omega * self.motor.inductance_h;
        let share = omega * self.motor.flux_wb / (r * r + x * x);
        let settled = |[cos, sin]: [f64; 2]| {
            [
                u[0] / r - share * (x * cos - r * sin),
                u[1] / r - share * (r * cos + x * sin),
            ]
        };
        let before = settled(self.direction);
        self.turn(time_s);
        let after = settled(self.direction);
        for axis in 0..2 {
            self.i[axis] = settle(after[axis] + (self.i[axis] - before[axis]) * self.decay.1);
        }
    }

    /// Diodes carry the currents on against the supply until they are zero.
    fn freewheel(&mut self, bus_v: f64, time_s: f64) {
        self.turn(time_s);
        let [alpha, beta] = self.i;
        let magnitude = (alpha * alpha + beta * beta).sqrt();
        // The conducting phases' diodes hold the vector 2/3 of the supply against the current.
        let fall = 2.0 / 3.0 * bus_v / self.motor.inductance_h * time_s;
        let share = if magnitude > fall {
            1.0 - fall / magnitude
        } else {
            0.0
        };
        self.i = [alpha * share, beta * share];
    }

    fn accelerate(&mut self, time_s: f64) {
        if self.imposed_rad_s.is_none() {
            let torque = self.torque_nm() - self.load.torque_at(self.speed_rad_s);
            self.speed_rad_s = settle(self.speed_rad_s + torque / self.inertia_kgm2 * time_s);
        }
    }

    /// Turns the rotor on at its present speed.
    fn turn(&mut self, time_s: f64) {
        let radians = self.speed_rad_s * f64::from(self.motor.pole_pairs) * time_s;
        self.angle_turns = fraction(self.angle_turns + radians / TAU);
        let ([cos, sin], [cos_step, sin_step]) = (self.direction, rotation(radians));
        let [cos, sin] = [
            cos * cos_step - sin * sin_step,
            sin * cos_step + cos * sin_step,
        ];
        // One Newton step towards length 1 keeps the rounding from adding up.
        let correction = 1.5 - 0.5 * (cos * cos + sin * sin);
        self.direction = [cos * correction, sin * correction];
    }

    fn power(&self, drive: Drive) -> Flow {
        let torque_nm = self.torque_nm();
        let [alpha, beta] = self.i;
        let motor_w = match drive {
            Drive::Off => 0.0,
            Drive::Phases(phases) => {
                let u = vector(phases);
                1.5 * (u[0] * alpha + u[1] * beta)
            }
        };
        Flow {
            torque_nm,
            torque_square: torque_nm * torque_nm,
            motor_w,
            copper_w: 1.5 * self.motor.resistance_ohm * (alpha * alpha + beta * beta),
        }
    }
}

/// Zero for what has decayed to nothing: arithmetic with subnormal numbers is many times slower.
fn settle(x: f64) -> f64 {
    if x.abs() < 1e-15 { 0.0 } else { x }
}

/// What is left of turns without whole ones, 0..1.
fn fraction(turns: f64) -> f64 {
    let rest = turns - (turns as i64) as f64;
    if rest < 0.0 { rest + 1.0 } else { rest }
}

/// Cosine and sine. Taylor's series up to the twelfth power for what a rotor turns in a fraction
/// of a period; its remainder at 0.3 rad is below the numbers' resolution.
fn rotation(radians: f64) -> [f64; 2] {
    if radians.abs() > 0.3 {
        let (sin, cos) = libm::sincos(radians);
        return [cos, sin];
    }
    let x = radians * radians;
    let mut cos = 0.0;
    let mut sin = 0.0;
    for (even, odd) in [
        (12.0 * 11.0, 13.0 * 12.0),
        (10.0 * 9.0, 11.0 * 10.0),
        (8.0 * 7.0, 9.0 * 8.0),
        (6.0 * 5.0, 7.0 * 6.0),
        (4.0 * 3.0, 5.0 * 4.0),
        (2.0, 3.0 * 2.0),
    ] {
        // Horner's rule: 1 − x/(1·2)·(1 − x/(3·4)·(...)).
        cos = (1.0 - cos) * (x * (1.0 / even));
        sin = (1.0 - sin) * (x * (1.0 / odd));
    }
    [1.0 - cos, radians * (1.0 - sin)]
}

const HALF_ROOT_3: f64 = 0.866_025_403_784_438_6;

fn vector([a, b, c]: [f64; 3]) -> [f64; 2] {
    [(2.0 * a - b - c) / 3.0, (b - c) * (HALF_ROOT_3 * 2.0 / 3.0)]
}

/// The phase current below which a dead time's loss is in proportion to the current, A.
const SIGN_CERTAIN_A: f64 = 0.1;

/// One bit of a duty.
const DUTY_BIT: f64 = 1.0 / 2_147_483_648.0;

/// What a bridge at a supply makes of its command: the mean phase voltages, less what the dead
/// time takes by the sign of each current.
pub fn inverter(bridge: Bridge, bus_v: f64, currents_a: [f64; 3], dead_time_share: f64) -> Drive {
    match bridge {
        Bridge::Off | Bridge::Charge(_) | Bridge::Legs(_) => Drive::Off,
        Bridge::Brake => Drive::Phases([0.0; 3]),
        Bridge::Duty(duties) => {
            let mut phases = [0.0; 3];
            for phase in 0..3 {
                let sign = (currents_a[phase] / SIGN_CERTAIN_A).clamp(-1.0, 1.0);
                let duty = f64::from(duties[phase].to_bits()) * DUTY_BIT - sign * dead_time_share;
                phases[phase] = duty.clamp(0.0, 1.0) * bus_v;
            }
            Drive::Phases(phases)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOTOR: Motor = crate::bench::MOTORS[0].1;

    fn free(load: Load, speed_rad_s: f64) -> Averaged {
        Averaged::new(MOTOR, load, speed_rad_s, 0.1)
    }

    #[test]
    fn a_turn_is_as_libm_has_it() {
        for i in -50..=50 {
            let radians = f64::from(i) * 0.01;
            let (sin, cos) = libm::sincos(radians);
            let [c, s] = rotation(radians);
            assert!(
                (c - cos).abs() < 2e-16 && (s - sin).abs() < 2e-16,
                "{radians}"
            );
        }
        assert_eq!(fraction(-0.25), 0.75);
        assert_eq!(fraction(3.5), 0.5);
    }

    /// One half period in one piece against ten thousand, with the equations as they stand in the
    /// paper, stepped by Heun's rule.
    #[test]
    fn the_closed_solution_is_that_of_the_equations() {
        let speed_rad_s = 628.0;
        let phases = [14.0, 3.0, 9.0];
        let time_s = 1.0 / 30_000.0;
        let mut plant = free(
            Load {
                inertia_kgm2: 1e9,
                ..Load::default()
            },
            speed_rad_s,
        );
        plant.i = [3.0, -5.0];
        let omega = speed_rad_s * 12.0;
        let u = vector(phases);
        let derivative = |i: [f64; 2], t: f64| {
            let (sin, cos) = (TAU * 0.1 + omega * t).sin_cos();
            let emf = [-omega * MOTOR.flux_wb * sin, omega * MOTOR.flux_wb * cos];
            [0, 1].map(|k| (u[k] - MOTOR.resistance_ohm * i[k] - emf[k]) / MOTOR.inductance_h)
        };
        let steps = 10_000;
        let h = time_s / f64::from(steps);
        let mut i = plant.i;
        for step in 0..steps {
            let t = f64::from(step) * h;
            let first = derivative(i, t);
            let second = derivative([0, 1].map(|k| i[k] + h * first[k]), t + h);
            i = [0, 1].map(|k| i[k] + 0.5 * h * (first[k] + second[k]));
        }
        plant.advance(Drive::Phases(phases), 24.0, time_s);
        for axis in 0..2 {
            assert!(
                (plant.i[axis] - i[axis]).abs() < 1e-7,
                "{:?} {i:?}",
                plant.i
            );
        }
    }

    #[test]
    fn electrical_power_is_copper_loss_and_shaft_power_at_rest_of_the_currents() {
        // At standstill under a constant voltage all power becomes heat: i = u/R.
        let load = Load {
            inertia_kgm2: 1e9,
            ..Load::default()
        };
        let mut plant = free(load, 0.0);
        let mut flow = Flow::default();
        for _ in 0..2000 {
            flow = plant.advance(Drive::Phases([0.4, 0.0, 0.0]), 24.0, 1e-5);
        }
        assert!(
            (flow.motor_w - flow.copper_w).abs() < 1e-6 * flow.motor_w,
            "{flow:?}"
        );
        assert!((plant.currents_a()[0] - 0.4 * 2.0 / 3.0 / 0.108).abs() < 1e-9);
    }

    #[test]
    fn a_free_shaft_slows_down_as_the_load_says() {
        let load = Load {
            c1: 1e-4,
            inertia_kgm2: 1e-4,
            ..Load::default()
        };
        let mut plant = free(load, 100.0);
        for _ in 0..10_000 {
            plant.advance(Drive::Off, 24.0, 1e-4);
        }
        // e^(−c1/J·t) after 1 s.
        assert!((plant.speed_rad_s() - 100.0 * (-1.0_f64).exp()).abs() < 1e-3);
    }

    #[test]
    fn currents_die_against_the_supply_when_all_is_off() {
        let mut plant = free(
            Load {
                inertia_kgm2: 1.0,
                ..Load::default()
            },
            0.0,
        );
        plant.i = [10.0, 0.0];
        // 2/3·24 V across 30.6 µH: 10 A are gone after 19 µs.
        plant.advance(Drive::Off, 24.0, 15e-6);
        assert!(plant.i[0] > 1.0);
        plant.advance(Drive::Off, 24.0, 5e-6);
        assert_eq!(plant.i, [0.0, 0.0]);
    }

    #[test]
    fn dead_time_works_against_the_current() {
        let half = siskin_control::units::Duty::from_num(0.5);
        let bridge = Bridge::Duty([half; 3]);
        let Drive::Phases([a, b, c]) = inverter(bridge, 24.0, [5.0, -5.0, 0.0], 0.01) else {
            panic!("it switches");
        };
        assert!((a - 11.76).abs() < 1e-9 && (b - 12.24).abs() < 1e-9 && (c - 12.0).abs() < 1e-9);
    }
}
