//! The first paper's setup: its motor and load, the supply and the carrier.

use std::sync::LazyLock;

use crate::plant::{Motor, Sensing};
use crate::rig::Bench;

/// Table I.
pub(super) static MOTOR: LazyLock<Motor> = LazyLock::new(|| Bench::default().motor);

/// The supply, V. The paper does not say; 6000 rpm with sine modulation takes 21.8 V.
pub(super) const BUS_V: f64 = 24.0;

/// PWM and sampling, Hz (section III.C).
pub(super) const CARRIER_HZ: f64 = 15_000.0;

/// Phases of the carrier against the rotor among which a measurement is divided.
pub(super) const PHASES: u32 = 4;

/// Returns the electrical frequency, Hz.
pub(super) fn electrical_hz(rpm: f64) -> f64 {
    rpm * f64::from(MOTOR.pole_pairs) / 60.0
}

/// Returns sensing of exact currents: no steps, no noise.
pub(super) fn exact_sensing() -> Sensing {
    Sensing {
        bits: 0,
        noise_a: 0.0,
        ..Sensing::default()
    }
}

/// Returns the propeller's torque: quadratic through the one point printed in the paper, Nm.
pub(super) fn load_nm(rpm: f64) -> f64 {
    0.0972 * (rpm / 4500.0) * (rpm / 4500.0)
}
