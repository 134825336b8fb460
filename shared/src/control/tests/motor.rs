//! The motor of the first paper (1), (2) in double precision, and a current loop closed around it.

use std::f64::consts::TAU;

use siskin_units::{Current, Voltage, WideVoltage, narrow};

use super::{L, P, PHI, R, TS, Units};
use crate::control::inductance::Factor;
use crate::control::modulator::{self, VectorLimit};
use crate::control::regulator::{Feedback, Reference, State};
use crate::control::transform::Dq;

/// Model steps per period.
const PARTS: u32 = 16;

/// A motor with its load. Stator quantities are complex numbers, (α, β).
#[derive(Clone, Debug)]
pub(super) struct Motor {
    pub(super) inertia_kgm2: f64,
    /// Load of section V: c1·ω + c2·ω².
    pub(super) c1: f64,
    pub(super) c2: f64,
    /// The shaft is held at its speed.
    pub(super) held: bool,
    /// Mechanical speed, rad/s.
    pub(super) omega_m: f64,
    /// Electrical angle.
    theta: f64,
    pub(super) i: (f64, f64),
    /// Command of the last period, which acts in this one.
    pending: (f64, f64),
}

impl Motor {
    /// The bench of section V, turning at this speed without current.
    pub(super) fn bench(rpm: f64) -> Self {
        Self {
            inertia_kgm2: 1.43e-4,
            c1: 1.25e-4,
            c2: 0.3e-6,
            held: false,
            omega_m: rpm * TAU / 60.0,
            theta: 0.0,
            i: (0.0, 0.0),
            pending: (0.0, 0.0),
        }
    }

    /// Returns this motor with its shaft held at that speed.
    pub(super) fn held(rpm: f64) -> Self {
        Self {
            held: true,
            ..Self::bench(rpm)
        }
    }

    /// Electrical speed, rad/s.
    pub(super) fn omega(&self) -> f64 {
        P * self.omega_m
    }

    pub(super) fn rpm(&self) -> f64 {
        self.omega_m * 60.0 / TAU
    }

    /// i_d and i_q, A.
    pub(super) fn i_dq(&self) -> (f64, f64) {
        turned(self.i, -self.theta)
    }

    pub(super) fn torque_nm(&self) -> f64 {
        1.5 * P * PHI * self.i_dq().1
    }

    /// Runs one period, at whose end the command for the next one is ready: d and q in the sample's
    /// frame, aimed at the middle of the period in which it acts.
    pub(super) fn period(&mut self, u_dq: (f64, f64)) {
        let acting = self.pending;
        self.pending = turned(u_dq, self.theta + 1.5 * self.omega() * TS);
        let dt = TS / f64::from(PARTS);
        for _ in 0..PARTS {
            let omega = self.omega();
            // Midpoint rule: back-EMF and resistive drop in the middle of the step.
            let middle = self.theta + 0.5 * omega * dt;
            let e = (-omega * PHI * middle.sin(), omega * PHI * middle.cos());
            let decay = 0.5 * R * dt / L;
            let next =
                |i: f64, u: f64, e: f64| (i * (1.0 - decay) + (u - e) * dt / L) / (1.0 + decay);
            self.i = (next(self.i.0, acting.0, e.0), next(self.i.1, acting.1, e.1));
            if !self.held {
                let load = (self.c1 + self.c2 * self.omega_m.abs()) * self.omega_m;
                self.omega_m += (self.torque_nm() - load) / self.inertia_kgm2 * dt;
            }
            self.theta += omega * dt;
        }
    }
}

/// Returns a vector turned ahead by an angle.
fn turned((x, y): (f64, f64), angle: f64) -> (f64, f64) {
    let (sin, cos) = angle.sin_cos();
    (x * cos - y * sin, x * sin + y * cos)
}

/// A motor, a current regulator that knows the rotor's position, and a voltage limit.
pub(super) struct Loop {
    pub(super) units: Units,
    pub(super) regulator: State,
    pub(super) motor: Motor,
    pub(super) vector_max: Voltage,
    /// i_q* minus i_q while the voltage is limited.
    pub(super) i_q_shortfall: Current,
}

impl Loop {
    /// At 24 V.
    pub(super) fn new(units: Units, motor: Motor) -> Self {
        Self {
            vector_max: units.voltage(13.4),
            regulator: State::default(),
            i_q_shortfall: Current::ZERO,
            units,
            motor,
        }
    }

    /// Returns the estimate of an observer without errors.
    pub(super) fn feedback(&self) -> Feedback {
        let (i_d, i_q) = self.motor.i_dq();
        let i = Dq {
            d: self.units.current(i_d),
            q: self.units.current(i_q),
        };
        Feedback {
            omega: self.units.speed(self.motor.omega()),
            i,
            i_hat: i,
            h_hat: Dq {
                d: WideVoltage::ZERO,
                q: self.units.wide(-self.motor.omega() * PHI),
            },
            inductance: Factor::ONE,
        }
    }

    /// Runs one period; returns the commanded voltage, V.
    pub(super) fn period(&mut self, wanted: &Reference) -> (f64, f64) {
        let feedback = self.feedback();
        let regulator = &self.units.0.regulator;
        regulator.schedule_gains(&mut self.regulator, feedback.omega, feedback.inductance);
        let asked = regulator.voltage(&self.regulator, wanted, &feedback);
        let (u, cut) = modulator::limit(asked, &VectorLimit::new(self.vector_max, narrow(asked.d)));
        regulator.integrate(&mut self.regulator, wanted, &feedback);
        if let Some(cut) = cut {
            regulator.anti_windup(&mut self.regulator, cut);
        }
        self.i_q_shortfall = if cut.is_some() {
            wanted.i.q - feedback.i.q
        } else {
            Current::ZERO
        };
        let u = (self.units.volts(u.d), self.units.volts(u.q));
        self.motor.period(u);
        u
    }
}
