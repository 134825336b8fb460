//! Sensorless field-oriented speed control in single precision.

use std::f32::consts::{PI, TAU};

use super::setting::{
    FLUX_WB, INDUCTANCE_H, INERTIA_KGM2, PERIOD_S, POLE_PAIRS, RESISTANCE_OHM, RPM,
};

const PERIOD: f32 = PERIOD_S as f32;
const R: f32 = RESISTANCE_OHM as f32;
const L: f32 = INDUCTANCE_H as f32;
const INVERSE_ROOT_3: f32 = 0.577_350_27;
const HALF_ROOT_3: f32 = 0.866_025_4;

/// Bandwidths of the current and speed loops, rad/s.
const CURRENT_BANDWIDTH: f32 = 2.0 * PI * 600.0;
const SPEED_BANDWIDTH: f32 = 2.0 * PI * 5.0;

/// Current per electrical speed error, A·s/rad: an ampere accelerates by p²·φ·1.5/J.
const SPEED_KP: f32 = SPEED_BANDWIDTH * INERTIA_KGM2 as f32
    / (1.5 * FLUX_WB as f32 * (POLE_PAIRS * POLE_PAIRS) as f32);
const SPEED_KI: f32 = 0.25 * SPEED_KP * SPEED_BANDWIDTH;

/// Greatest torque current, A.
const CURRENT_LIMIT: f32 = 30.0;

/// Share of the back-EMF error that the observer corrects per period.
const OBSERVER_GAIN: f32 = 0.2;

/// The phase-locked loop's natural frequency, rad/s, critically damped.
const PLL_BANDWIDTH: f32 = 2.0 * PI * 40.0;

/// Delay from the sample to the middle of the period in which the voltage applies, periods.
const DELAY: f32 = 1.5;

#[derive(Clone, Debug)]
pub(super) struct Control {
    /// Estimated electrical angle, rad.
    angle: f32,
    /// Estimated electrical speed, rad/s.
    speed: f32,
    /// Estimated back-EMF in rotor coordinates, V.
    emf: [f32; 2],
    /// Currents of the previous sample, A.
    current: [f32; 2],
    /// Integral parts of the current loop, V, and of the speed loop, A.
    voltage_integral: [f32; 2],
    current_integral: f32,
    /// The last command, which applies until the next sample, and the one before, V.
    voltage: [[f32; 2]; 2],
}

impl Control {
    pub(super) fn new() -> Self {
        let speed = RPM as f32 / 60.0 * TAU * POLE_PAIRS as f32;
        Self {
            angle: 0.0,
            speed,
            emf: [0.0, speed * FLUX_WB as f32],
            current: [0.0; 2],
            voltage_integral: [0.0; 2],
            current_integral: 0.0,
            voltage: [[0.0; 2]; 2],
        }
    }

    /// Computes the legs' duties, 0..1, from the phase currents, A, and the supply's voltage.
    pub(super) fn step(&mut self, [a, b, c]: [f32; 3], bus_v: f32) -> [f32; 3] {
        // Clarke and Park.
        let alpha = (2.0 * a - b - c) / 3.0;
        let beta = (b - c) * INVERSE_ROOT_3;
        let (sin, cos) = libm::sincosf(self.angle);
        let current = [alpha * cos + beta * sin, beta * cos - alpha * sin];

        self.observe(current);
        let reference = self.speed_loop();
        let voltage = self.current_loop(current, reference, bus_v);
        self.voltage = [voltage, self.voltage[0]];

        // Inverse Park, to where the rotor will be.
        let ahead = self.angle + DELAY * PERIOD * self.speed;
        let (sin, cos) = libm::sincosf(ahead);
        let [d, q] = voltage;
        let duties = modulate([d * cos - q * sin, d * sin + q * cos], bus_v);
        self.turn();
        duties
    }

    /// Attributes to the back-EMF what moved the currents beyond voltage and impedance.
    fn observe(&mut self, current: [f32; 2]) {
        let [d, q] = self.current;
        let [u_d, u_q] = self.voltage[1];
        let x = self.speed * L;
        let predicted = [
            d + PERIOD / L * (u_d - R * d + x * q - self.emf[0]),
            q + PERIOD / L * (u_q - R * q - x * d - self.emf[1]),
        ];
        let gain = OBSERVER_GAIN * L / PERIOD;
        self.emf[0] -= gain * (current[0] - predicted[0]);
        self.emf[1] -= gain * (current[1] - predicted[1]);
        self.current = current;
    }

    /// Runs the phase-locked loop: a rotor ahead of its estimate shows a negative e_d.
    fn turn(&mut self) {
        let [d, q] = self.emf;
        let error = -d / (d * d + q * q).sqrt().max(0.1);
        self.speed += PERIOD * PLL_BANDWIDTH * PLL_BANDWIDTH * error;
        let turned = PERIOD * (self.speed + 2.0 * PLL_BANDWIDTH * error);
        self.angle += turned;
        if self.angle >= TAU {
            self.angle -= TAU;
        } else if self.angle < 0.0 {
            self.angle += TAU;
        }
    }

    /// Returns the torque current for the speed.
    fn speed_loop(&mut self) -> f32 {
        let error = RPM as f32 / 60.0 * TAU * POLE_PAIRS as f32 - self.speed;
        let integral = self.current_integral + SPEED_KI * PERIOD * error;
        self.current_integral = integral.clamp(-CURRENT_LIMIT, CURRENT_LIMIT);
        (SPEED_KP * error + self.current_integral).clamp(-CURRENT_LIMIT, CURRENT_LIMIT)
    }

    /// Returns the voltages for the currents, with decoupled axes, within the hexagon's circle.
    fn current_loop(&mut self, [d, q]: [f32; 2], reference: f32, bus_v: f32) -> [f32; 2] {
        let error = [-d, reference - q];
        let kp = L * CURRENT_BANDWIDTH;
        let ki = R * CURRENT_BANDWIDTH * PERIOD;
        let integral = [
            self.voltage_integral[0] + ki * error[0],
            self.voltage_integral[1] + ki * error[1],
        ];
        let x = self.speed * L;
        let voltage = [
            kp * error[0] + integral[0] - x * q,
            kp * error[1] + integral[1] + x * d + self.speed * FLUX_WB as f32,
        ];
        let limit = bus_v * INVERSE_ROOT_3;
        let square = voltage[0] * voltage[0] + voltage[1] * voltage[1];
        if square > limit * limit {
            // At the limit the integrators hold.
            let share = limit / square.sqrt();
            return voltage.map(|volts| volts * share);
        }
        self.voltage_integral = integral;
        voltage
    }

    pub(super) fn angle_rad(&self) -> f64 {
        f64::from(self.angle)
    }
}

/// Space-vector modulation: centres the three phases between the supply's poles.
fn modulate([alpha, beta]: [f32; 2], bus_v: f32) -> [f32; 3] {
    let phases = [
        alpha,
        HALF_ROOT_3 * beta - 0.5 * alpha,
        -HALF_ROOT_3 * beta - 0.5 * alpha,
    ];
    let greatest = phases[0].max(phases[1]).max(phases[2]);
    let least = phases[0].min(phases[1]).min(phases[2]);
    let centre = 0.5 * (greatest + least);
    phases.map(|volts| (0.5 + (volts - centre) / bus_v).clamp(0.0, 1.0))
}
