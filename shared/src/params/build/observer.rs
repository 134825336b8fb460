//! The observers' coefficients.

use core::f32::consts::TAU;

use super::{BuildError, Si, gain};
use crate::control::delay::Delay;
use crate::control::observer::back_emf;
use crate::params::ParamId;
use crate::units::{InverseFlux, Scale};

/// ξ of the stated flux in the control's units: the voltage base makes it so for every motor.
const XI_NOMINAL: f32 = 0.25;

/// Poles of the attitude observer (22) over the current bandwidth: Table III has 425.6 against
/// 2357 1/s.
const ATTITUDE_SHARE: f32 = 0.1806;

/// k_f over the current bandwidth: 500 against 2357 1/s (section V).
const FILTER_SHARE: f32 = 0.2121;

/// (6), (7), (20), (22), (28).
pub(super) fn back_emf(
    p: &Si,
    scale: &Scale,
    delay: Delay,
) -> Result<back_emf::Config, BuildError> {
    let r_over_l = p.resistance_ohm / p.inductance_h;
    let decay = -libm::expm1f(-r_over_l * p.period_s);
    // The time for which a constant derivative acts in a period: (1 − e^(−R·T_s/L))·L/R.
    let acts_s = decay / r_over_l;
    let current_per_voltage = scale.voltage_v / scale.current_a;
    let rad_per_unit = TAU / p.period_s;

    // λ² + (R/L + k_p)·λ + k_i/L with both poles at (−1 ± i)/ε (20).
    let k_p = 2.0 * p.current_rad_s - r_over_l;
    let k_i = 2.0 * p.inductance_h * p.current_rad_s * p.current_rad_s;
    // λ² + χ·k_η·λ + χ²·γ with both poles at (−1 ± i)·s (22).
    let chi = p.linearised_rad_s * p.flux_wb;
    let pole_rad_s = ATTITUDE_SHARE * p.current_rad_s;
    let k_eta = 2.0 * pole_rad_s / chi;
    let gamma = 2.0 * pole_rad_s * pole_rad_s / (chi * chi);

    Ok(back_emf::Config {
        delay,
        decay: gain(ParamId::MotRMohm, decay)?,
        admittance: gain(
            ParamId::MotLUh,
            acts_s / p.inductance_h * current_per_voltage,
        )?,
        rotation: gain(ParamId::MotLUh, acts_s * rad_per_unit)?,
        k_p: gain(ParamId::CtlBwCurHz, k_p * acts_s)?,
        k_i: gain(ParamId::CtlBwCurHz, k_i * p.period_s / current_per_voltage)?,
        k_eta: gain(ParamId::CtlBwCurHz, k_eta * scale.voltage_v / rad_per_unit)?,
        gamma: gain(
            ParamId::CtlBwCurHz,
            gamma * p.period_s * scale.voltage_v / scale.inverse_flux_per_wb(),
        )?,
        k_f: gain(
            ParamId::CtlBwCurHz,
            FILTER_SHARE * p.current_rad_s * p.period_s,
        )?,
        xi_nominal: InverseFlux::from_num(XI_NOMINAL),
        xi_min: InverseFlux::from_num(XI_NOMINAL / 2.0),
        // Twice the nominal is one bit more than the type holds.
        xi_max: InverseFlux::MAX,
    })
}
