//! The outer loop's coefficients.

use core::f32::consts::TAU;

use super::{BuildError, Si, gain};
use crate::control::speed;
use crate::params::ParamId;
use crate::units::Scale;

/// k_iω/k_pω over k_pω/J: Table III has 5.87 against 49.65 1/s.
const SPEED_CORNER_SHARE: f32 = 0.1183;

/// (8), from the bandwidth and the inertia.
pub(super) fn speed(p: &Si, scale: &Scale) -> Result<speed::Config, BuildError> {
    let rad_per_unit = TAU / (p.pole_pairs * p.period_s);
    let k_p = p.inertia_kgm2 * p.speed_rad_s;
    let k_i = k_p * SPEED_CORNER_SHARE * p.speed_rad_s;
    let torque_per_speed = rad_per_unit / scale.torque_nm();
    Ok(speed::Config {
        k_p: gain(ParamId::CtlBwSpdHz, k_p * torque_per_speed)?,
        k_i: gain(ParamId::CtlBwSpdHz, k_i * p.period_s * torque_per_speed)?,
    })
}
