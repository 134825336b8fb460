//! The current regulators' coefficients.

use core::f32::consts::TAU;

use super::{BuildError, Si, gain};
use crate::control::regulator::observer_based as regulator;
use crate::params::ParamId;
use crate::units::Scale;

/// Poles of the current regulator (21): Table III has −2357 and −2142, the second at 0.909.
const SECOND_POLE_SHARE: f32 = 0.909;

/// (10), (21).
pub(super) fn observer_based(p: &Si, scale: &Scale) -> Result<regulator::Config, BuildError> {
    let voltage_per_current = scale.current_a / scale.voltage_v;
    let r_over_l = p.resistance_ohm / p.inductance_h;
    // λ² + (R/L + k_pe)·λ + k_ie/L with poles at −1/ε and −0.909/ε (21).
    let k_pe = (1.0 + SECOND_POLE_SHARE) * p.current_rad_s - r_over_l;
    let k_ie = SECOND_POLE_SHARE * p.inductance_h * p.current_rad_s * p.current_rad_s;
    Ok(regulator::Config {
        resistance: gain(ParamId::MotRMohm, p.resistance_ohm * voltage_per_current)?,
        reactance: gain(
            ParamId::MotLUh,
            p.inductance_h * voltage_per_current * TAU / p.period_s,
        )?,
        inductance: gain(
            ParamId::MotLUh,
            p.inductance_h * voltage_per_current / p.period_s,
        )?,
        k_pe: gain(
            ParamId::CtlBwCurHz,
            p.inductance_h * k_pe * voltage_per_current,
        )?,
        k_ie: gain(ParamId::CtlBwCurHz, k_ie * p.period_s * voltage_per_current)?,
    })
}
