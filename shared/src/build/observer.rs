//! Coefficients of the observers.

use core::f32::consts::TAU;

use siskin_params::choice::{CtlObsCure, CtlObserver};
use siskin_params::{Delay, ParamId, parts};
use siskin_units::math::{EIGHTH_PI, Multiplier, Real, settled, square_root};
use siskin_units::{INVERSE_FLUX_NOMINAL, InverseFlux, Speed};

use super::TORQUE_DROP_SHARE;
use super::flux;
use super::si::{LINEARISED_SHARE, Si};
use crate::control::observer::back_emf::Cure;
use crate::control::observer::{self, back_emf, compensated, edges};

/// Poles of the attitude observer (22) over the current bandwidth: Table III has 425.6 against 2357 1/s.
const ATTITUDE_SHARE: f32 = 0.1806;

/// k_f over the current bandwidth: 500 against 2357 1/s (section V).
const FILTER_SHARE: f32 = 0.2121;

/// ω_n of the loop that cures the published observer, 1/s.
const CURE_RAD_S: f32 = 400.0;

/// Least ω⁺, 1/s.
const OMEGA_MIN_RAD_S: f32 = 60.0;

/// Least and greatest ω_n of the loop, 1/s, unless the current asks for more.
const OMEGA_N_RAD_S: [f32; 2] = [150.0, 1000.0];

/// ω_n over the square root of the acceleration that `LIM_PHASE_A` gives the rotor, rad/s²: the loop then lags by 1/2²
/// rad, 14°. If slower, it would lose a rotor that is light for its speed.
const FOLLOWING: f32 = 2.0;

/// Share of `LIM_PHASE_A` from which that ω_n applies; below it, ω_n is proportional to the current, and the loop lags
/// no more down to a 25th of the limit.
const FOLLOWING_SHARE: f32 = 0.2;

/// Up to `LIM_PHASE_A` the current's bound rises with speed (`TORQUE_DROP_SHARE`), and so does ω_n
/// (`compensated::OMEGA_N_SHARE`): once that matches what such a current needs, more is not needed.
const CAUGHT_UP: f32 = TORQUE_DROP_SHARE / 0.35;

/// Greatest ω_n over the PWM frequency: the loop is discrete.
const OMEGA_N_SHARE_MAX: f32 = 0.05;

/// Corner of the speed's smoothing above the loop's integrator, 1/s.
const SMOOTHING_RAD_S: f32 = 300.0;

/// Flux of a unit of current, in units of flux: at up to a unit and a half of current the stator's flux stays within
/// the eight units of its type. That is an L·i of 9.4 times the stated flux at the end of the converter's range.
const INDUCTANCE_MAX: f32 = 4.0;

/// Sets up the observer that `CTL_OBSERVER` selects.
pub(super) fn observer(p: &Si, place: &mut observer::Config) {
    match p.choice() {
        CtlObserver::BackEmf => {
            if let Some(part) = parts::BackEmf::get() {
                *place = observer::Config::BackEmf(back_emf::Config::default(), part);
            }
        }
        CtlObserver::FluxCrossings | CtlObserver::Hall => {
            if let Some(edges) = flux::sensors(p).map(edges::Config::new) {
                *place = observer::Config::Edges(edges);
            }
        }
        CtlObserver::Compensated => {
            *place = observer::Config::Compensated(compensated::Config::default());
        }
    }
    match place {
        observer::Config::BackEmf(place, _) => back_emf(p, place),
        observer::Config::Edges(place) => flux::edges(p, place),
        observer::Config::Compensated(place) => compensated(p, place),
        observer::Config::Given(_) => {}
    }
}

/// Sets up the compensated flux observer.
fn compensated(p: &Si, place: &mut compensated::Config) {
    let flux_per_current = p.unit_a / p.unit_wb;
    let inductance = p.l * flux_per_current;
    p.refuse_if(
        inductance >= INDUCTANCE_MAX,
        ParamId::MotLUh,
        "too high for this flux and the board's range",
    );
    // If the voltage changes in the middle of the period, β is half, with the opposite sign.
    let beta_share = match p.board.delay {
        Delay::None(_) | Delay::One => 1.0,
        Delay::Half(_) => -0.5,
    };
    // β = R·T_s²/(12·L); the speed squared is in turns per period.
    let beta = p.r * p.t / p.l * TAU * TAU / 12.0 * beta_share;
    // ω_n squared over the current.
    let following = 1.5 * FOLLOWING * FOLLOWING * p.pole_pairs * p.pole_pairs * p.flux / p.j;
    let caught_up_rad_s = following * p.flux / p.r * CAUGHT_UP;
    let following_rad_s = caught_up_rad_s.min(square_root(following * p.limit_a));
    // In turns per period.
    let omega_n = (following_rad_s * p.t).min(OMEGA_N_SHARE_MAX) / TAU;
    let turns = |rad_s: f32| rad_s * p.t / TAU;
    place.half_resistance = p.factor(ParamId::MotRMohm, 0.5 * p.r * p.t * flux_per_current);
    place.inductance = p.factor(ParamId::MotLUh, inductance);
    place.bias = p.gain(ParamId::MotLUh, beta);
    place.omega_min = Speed::from_f32(turns(OMEGA_MIN_RAD_S));
    place.omega_n_min = Speed::from_f32(turns(OMEGA_N_RAD_S[0]));
    place.omega_n_per_current = p.gain(
        ParamId::MotJGcm2,
        omega_n * (1.0 / FOLLOWING_SHARE) / p.limit_a * p.unit_a,
    );
    place.omega_n_following = Speed::from_f32(omega_n);
    place.omega_n_max = Speed::from_f32(turns(OMEGA_N_RAD_S[1]).max(omega_n));
    place.smoothing = p.factor(ParamId::PwmFreqHz, SMOOTHING_RAD_S * p.t);
    place.xi_nominal = INVERSE_FLUX_NOMINAL;
    // The stated flux is 2/π.
    place.quarter_per_flux = Multiplier::from_bits(EIGHTH_PI.to_bits());
}

/// Sets up the adaptive back-EMF observer: (6), (7), (20), (22), (28).
fn back_emf(p: &Si, place: &mut back_emf::Config) {
    let current_per_voltage = p.unit_v / p.unit_a;
    let decay = settled(p.r_over_l * p.t);
    // The time for which a constant derivative acts in a period: (1 − e^(−R·T_s/L))·L/R.
    let acts_s = decay / p.r_over_l;
    // λ² + (R/L + k_p)·λ + k_i/L with both poles at (−1 ± i)/ε (20).
    let k_p = 2.0 * p.current_rad_s - p.r_over_l;
    let k_i = 2.0 * p.l * p.current_rad_s * p.current_rad_s;
    // λ² + χ·k_η·λ + χ²·γ with both poles at (−1 ± i)·s (22).
    let pole_rad_s = ATTITUDE_SHARE * p.current_rad_s;
    let linearised_rad_s = LINEARISED_SHARE * p.fastest_rpm * p.pole_pairs * TAU / 60.0;
    let chi = linearised_rad_s * p.flux;
    let k_eta = 2.0 * pole_rad_s / chi;
    let gamma = 2.0 * pole_rad_s * pole_rad_s / (chi * chi);
    let unit_per_wb = p.scale.inverse_flux_per_wb();
    place.delay = p.board.delay;
    place.decay = p.gain(ParamId::MotRMohm, decay);
    place.admittance = p.gain(ParamId::MotLUh, acts_s / p.l * current_per_voltage);
    place.rotation = p.gain(ParamId::MotLUh, acts_s * p.rad_per_unit);
    place.k_p = p.gain(ParamId::CtlBwCurHz, k_p * acts_s);
    place.k_i = p.gain(ParamId::CtlBwCurHz, k_i * p.t / current_per_voltage);
    place.k_eta = p.gain(ParamId::CtlBwCurHz, k_eta * p.unit_v / p.rad_per_unit);
    place.gamma = p.gain(ParamId::CtlBwCurHz, gamma * p.t * p.unit_v / unit_per_wb);
    place.k_f = p.gain(ParamId::CtlBwCurHz, FILTER_SHARE * p.current_rad_s * p.t);
    place.xi_nominal = INVERSE_FLUX_NOMINAL;
    place.xi_min = INVERSE_FLUX_NOMINAL / 2;
    // Twice the nominal is one bit more than the type holds.
    place.xi_max = InverseFlux::MAX;
    if p.chosen(CtlObsCure::Cured) {
        let cure = place.cure.insert(Cure::default());
        // The loop that cures the published observer.
        let omega_n = CURE_RAD_S * p.t;
        cure.proportional = p.gain(ParamId::CtlObsCure, 2.0 * omega_n / TAU);
        cure.integral = p.gain(ParamId::CtlObsCure, omega_n * omega_n / TAU);
    }
}
