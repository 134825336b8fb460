//! The motor in rotor coordinates (1)-(3), its circuit by the exact matrix exponential at the
//! period's speed, for the voltage in the rotor's frame at the middle of the period.

use std::f64::consts::TAU;

use super::setting::{
    BUS_V, FLUX_WB, INDUCTANCE_H, INERTIA_KGM2, PERIOD_S, POLE_PAIRS, RESISTANCE_OHM, RPM,
};

const HALF_ROOT_3: f64 = 0.866_025_403_784_438_6;

/// Viscous and aerodynamic coefficient of the propeller, Nm·s/rad and Nm·s²/rad².
const LOAD: [f64; 2] = [1.25e-4, 0.3e-6];

#[derive(Clone, Debug)]
pub(super) struct Plant {
    /// i_d and i_q, A.
    i: [f64; 2],
    /// Electrical angle, 0..2π.
    angle_rad: f64,
    /// Mechanical speed.
    speed_rad_s: f64,
    /// Remaining share of a transient current after a period, e^(−R·T/L).
    decay: f64,
}

impl Plant {
    pub(super) fn new() -> Self {
        Self {
            i: [0.0; 2],
            angle_rad: 0.0,
            speed_rad_s: RPM * TAU / 60.0,
            decay: libm::exp(-RESISTANCE_OHM / INDUCTANCE_H * PERIOD_S),
        }
    }

    /// Returns the currents into the phases, A.
    pub(super) fn currents_a(&self) -> [f64; 3] {
        let (sin, cos) = libm::sincos(self.angle_rad);
        let [d, q] = self.i;
        let (alpha, beta) = (d * cos - q * sin, d * sin + q * cos);
        [
            alpha,
            HALF_ROOT_3 * beta - 0.5 * alpha,
            -HALF_ROOT_3 * beta - 0.5 * alpha,
        ]
    }

    /// Advances the motor by a period with these duties of the three legs.
    pub(super) fn period(&mut self, [a, b, c]: [f64; 3]) {
        let omega = POLE_PAIRS * self.speed_rad_s;
        let alpha = BUS_V * (2.0 * a - b - c) / 3.0;
        let beta = BUS_V * (b - c) / (2.0 * HALF_ROOT_3);
        // The voltage in the rotor's frame at the middle of the period.
        let middle_rad = self.angle_rad + 0.5 * omega * PERIOD_S;
        let (sin, cos) = libm::sincos(middle_rad);
        let u_d = alpha * cos + beta * sin;
        let u_q = beta * cos - alpha * sin - omega * FLUX_WB;

        // di/dt = A·i + u/L with A = [−R/L, ω; −ω, −R/L]: i − i_settled decays and turns back.
        let reactance_ohm = omega * INDUCTANCE_H;
        let square = RESISTANCE_OHM * RESISTANCE_OHM + reactance_ohm * reactance_ohm;
        let settled_d = (RESISTANCE_OHM * u_d + reactance_ohm * u_q) / square;
        let settled_q = (RESISTANCE_OHM * u_q - reactance_ohm * u_d) / square;
        let turned_rad = omega * PERIOD_S;
        let (sin, cos) = libm::sincos(turned_rad);
        let decay = self.decay;
        let (d, q) = (self.i[0] - settled_d, self.i[1] - settled_q);
        let before_q = self.i[1];
        self.i = [
            settled_d + decay * (d * cos + q * sin),
            settled_q + decay * (q * cos - d * sin),
        ];

        let torque_nm = 1.5 * POLE_PAIRS * FLUX_WB * 0.5 * (before_q + self.i[1]);
        let speed = self.speed_rad_s;
        let load_nm = LOAD[0] * speed + LOAD[1] * speed.abs() * speed;
        self.speed_rad_s += PERIOD_S * (torque_nm - load_nm) / INERTIA_KGM2;
        self.angle_rad += turned_rad;
        if self.angle_rad >= TAU {
            self.angle_rad -= TAU;
        } else if self.angle_rad < 0.0 {
            self.angle_rad += TAU;
        }
    }

    pub(super) fn rpm(&self) -> f64 {
        self.speed_rad_s * 60.0 / TAU
    }

    pub(super) fn angle_rad(&self) -> f64 {
        self.angle_rad
    }
}
