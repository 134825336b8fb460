//! The observers' coefficients.

use core::f32::consts::TAU;

use super::flux;
use super::si::Si;
use crate::control::delay::Delay;
use crate::control::observer::back_emf::Cure;
use crate::control::observer::{self, back_emf, compensated};
use crate::math::{EIGHTH_PI, Multiplier, Real, settled};
use crate::params::ParamId;
use crate::params::choice::{CtlObsCure, CtlObserver};
use crate::units::{INVERSE_FLUX_NOMINAL, InverseFlux, Speed};

/// Poles of the attitude observer (22) over the current bandwidth: Table III has 425.6 against
/// 2357 1/s.
const ATTITUDE_SHARE: f32 = 0.1806;

/// k_f over the current bandwidth: 500 against 2357 1/s (section V).
const FILTER_SHARE: f32 = 0.2121;

/// ω_n of the loop that cures the published observer, 1/s.
const CURE_RAD_S: f32 = 400.0;

/// ω⁺ at the least, 1/s.
const OMEGA_MIN_RAD_S: f32 = 60.0;

/// Least and greatest ω_n of the loop, 1/s.
const OMEGA_N_RAD_S: [f32; 2] = [150.0, 1000.0];

/// Corner of the speed's part above the loop's integrator, 1/s.
const SMOOTHING_RAD_S: f32 = 300.0;

/// Flux of a unit of current, in units of flux: with up to a unit and a half of current the stator's
/// flux stays within the eight units of its type. That is L·i of 9.4 times the stated flux at the end
/// of the converter's range.
const INDUCTANCE_MAX: f32 = 4.0;

/// The observer that `CTL_OBSERVER` names.
pub(super) fn observer(p: &Si) -> observer::Config {
    match p.choice() {
        CtlObserver::BackEmf => {
            let mut config = back_emf(p);
            if p.chosen(CtlObsCure::Cured) {
                config.cure = Some(cure(p));
            }
            observer::Config::BackEmf(config)
        }
        CtlObserver::FluxCrossings | CtlObserver::Hall => observer::Config::Edges(flux::edges(p)),
        CtlObserver::Compensated => observer::Config::Compensated(compensated(p)),
    }
}

/// The compensated flux observer.
fn compensated(p: &Si) -> compensated::Config {
    let flux_per_current = p.scale.current_a / p.scale.flux_wb();
    // β = R·T_s²/(12·L); under a voltage that changes in the middle of the period half of it, the
    // other way. The square of the speed is in turns a period.
    let bias = p.resistance_ohm * p.period_s / p.inductance_h * TAU * TAU / 12.0;
    let bias = match p.board.delay {
        Delay::None | Delay::One => bias,
        Delay::Half => -0.5 * bias,
    };
    let speed = |rad_s: f32| Speed::from_f32(rad_s * p.period_s / TAU);
    p.refuse_if(
        p.inductance_h * flux_per_current >= INDUCTANCE_MAX,
        ParamId::MotLUh,
        "too high for this flux and the board's range",
    );
    compensated::Config {
        half_resistance: p.factor(
            ParamId::MotRMohm,
            0.5 * p.resistance_ohm * p.period_s * flux_per_current,
        ),
        inductance: p.factor(ParamId::MotLUh, p.inductance_h * flux_per_current),
        bias: p.gain(ParamId::MotLUh, bias),
        omega_min: speed(OMEGA_MIN_RAD_S),
        omega_n_min: speed(OMEGA_N_RAD_S[0]),
        omega_n_max: speed(OMEGA_N_RAD_S[1]),
        smoothing: p.factor(ParamId::PwmFreqHz, SMOOTHING_RAD_S * p.period_s),
        xi_nominal: INVERSE_FLUX_NOMINAL,
        // The stated flux is 2/π.
        quarter_per_flux: Multiplier::from_bits(EIGHTH_PI.to_bits()),
    }
}

/// The adaptive back-EMF observer (6), (7), (20), (22), (28).
fn back_emf(p: &Si) -> back_emf::Config {
    let r_over_l = p.resistance_ohm / p.inductance_h;
    let decay = settled(r_over_l * p.period_s);
    // The time for which a constant derivative acts in a period: (1 − e^(−R·T_s/L))·L/R.
    let acts_s = decay / r_over_l;
    let current_per_voltage = p.scale.voltage_v / p.scale.current_a;
    let rad_per_unit = TAU / p.period_s;

    // λ² + (R/L + k_p)·λ + k_i/L with both poles at (−1 ± i)/ε (20).
    let k_p = 2.0 * p.current_rad_s - r_over_l;
    let k_i = 2.0 * p.inductance_h * p.current_rad_s * p.current_rad_s;
    // λ² + χ·k_η·λ + χ²·γ with both poles at (−1 ± i)·s (22).
    let chi = p.linearised_rad_s * p.flux_wb;
    let pole_rad_s = ATTITUDE_SHARE * p.current_rad_s;
    let k_eta = 2.0 * pole_rad_s / chi;
    let gamma = 2.0 * pole_rad_s * pole_rad_s / (chi * chi);

    back_emf::Config {
        delay: p.board.delay,
        decay: p.gain(ParamId::MotRMohm, decay),
        admittance: p.gain(
            ParamId::MotLUh,
            acts_s / p.inductance_h * current_per_voltage,
        ),
        rotation: p.gain(ParamId::MotLUh, acts_s * rad_per_unit),
        k_p: p.gain(ParamId::CtlBwCurHz, k_p * acts_s),
        k_i: p.gain(ParamId::CtlBwCurHz, k_i * p.period_s / current_per_voltage),
        k_eta: p.gain(
            ParamId::CtlBwCurHz,
            k_eta * p.scale.voltage_v / rad_per_unit,
        ),
        gamma: p.gain(
            ParamId::CtlBwCurHz,
            gamma * p.period_s * p.scale.voltage_v / p.scale.inverse_flux_per_wb(),
        ),
        k_f: p.gain(
            ParamId::CtlBwCurHz,
            FILTER_SHARE * p.current_rad_s * p.period_s,
        ),
        xi_nominal: INVERSE_FLUX_NOMINAL,
        xi_min: INVERSE_FLUX_NOMINAL / 2,
        // Twice the nominal is one bit more than the type holds.
        xi_max: InverseFlux::MAX,
        cure: None,
    }
}

/// The loop that cures the published observer.
fn cure(p: &Si) -> Cure {
    let omega_n = CURE_RAD_S * p.period_s;
    Cure {
        proportional: p.gain(ParamId::CtlObsCure, 2.0 * omega_n / TAU),
        integral: p.gain(ParamId::CtlObsCure, omega_n * omega_n / TAU),
    }
}
