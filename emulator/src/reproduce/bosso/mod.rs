//! The first paper's figures: section III with the exact angle, Tables II and III, and section V
//! without a position sensor.
//!
//! Nothing is fitted to what the paper prints but the real motor's iron loss, which is that of figure
//! 7(d) at 4500 rpm: its offset there is no result. Where the paper is silent a choice stands beside
//! the result.

mod counts;
mod course;
mod dynamics;
mod figure_7;
mod foc;
mod gains;
mod ideal;
mod maps;
mod means;
mod sensorless;
mod six_step;

use std::sync::LazyLock;

use super::{Item, Reproduction, item};
use crate::plant::{Motor, Sensing};
use crate::rig::Bench;

/// Table I.
static MOTOR: LazyLock<Motor> = LazyLock::new(|| Bench::default().motor);

/// The supply, V. The paper does not say; 6000 rpm with sine modulation take 21.8 V.
const BUS_V: f64 = 24.0;

/// PWM and sampling, Hz (section III.C).
const CARRIER_HZ: f64 = 15_000.0;

/// Phases of the carrier against the rotor over which a measurement is shared out.
const PHASES: u32 = 4;

/// Electrical frequency, Hz.
fn electrical_hz(rpm: f64) -> f64 {
    rpm * f64::from(MOTOR.pole_pairs) / 60.0
}

/// Currents as they are: no steps, no noise.
fn exact_sensing() -> Sensing {
    Sensing {
        bits: 0,
        noise_a: 0.0,
        ..Sensing::default()
    }
}

/// The propeller's torque: quadratic through the one point that the paper prints, Nm.
fn load_nm(rpm: f64) -> f64 {
    0.0972 * (rpm / 4500.0) * (rpm / 4500.0)
}

/// The first paper's figures.
pub fn bosso() -> Reproduction {
    let ((ideal, maps), (figure_7, figures_8_and_9)) = rayon::join(
        || rayon::join(ideal::items, maps::figures),
        || rayon::join(figure_7::figure_7, dynamics::figures_8_and_9),
    );
    let mut items = ideal;
    items.extend(counts::items());
    items.extend(gains::items());
    items.extend(figure_7.0);
    items.extend(figures_8_and_9.0);
    let mut figures = maps;
    figures.push(figure_7.1);
    figures.extend(figures_8_and_9.1);
    Reproduction { items, figures }
}
