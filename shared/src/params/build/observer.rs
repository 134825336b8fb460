//! Coefficients of the observers.

use super::TORQUE_DROP_SHARE;
use super::flux;
use super::formula::{fill, formulas, value};
use super::quantity::Quantity;
use super::si::Si;
use crate::control::delay::Delay;
use crate::control::observer::back_emf::Cure;
use crate::control::observer::{self, back_emf, compensated, edges};
use crate::math::{EIGHTH_PI, Multiplier, settled, square_root};
use crate::params::ParamId;
use crate::params::choice::{CtlObsCure, CtlObserver};
use crate::parts;
use crate::units::{INVERSE_FLUX_NOMINAL, InverseFlux};

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
    let formulas = formulas!(p, {
        value own_flux(L * FluxPerCurrent),
        // ω_n squared over the current.
        define Following([1.5 * FOLLOWING * FOLLOWING] * PolePairs * PolePairs * Flux / J),
        value following(Following * LimitA),
    });
    p.refuse_if(
        formulas.value() >= INDUCTANCE_MAX,
        ParamId::MotLUh,
        "too high for this flux and the board's range",
    );
    p.set(Quantity::OmegaN, square_root(formulas.value()));
    // If the voltage changes in the middle of the period, β is half, with the opposite sign.
    let share = match p.board.delay {
        Delay::None(_) | Delay::One => 1.0,
        Delay::Half(_) => -0.5,
    };
    p.set(Quantity::Share, share);
    fill!(p, place, {
        factor half_resistance(MotRMohm, [0.5] * R * T * FluxPerCurrent),
        factor inductance(MotLUh, L * FluxPerCurrent),
        // β = R·T_s²/(12·L); the speed squared is in turns per period.
        gain bias(MotLUh, R * T / L * Tau * Tau / [12.0] * Share),
        number omega_min([OMEGA_MIN_RAD_S] * T / Tau),
        define OmegaN(Following * Flux / R * [CAUGHT_UP] min OmegaN * T min [OMEGA_N_SHARE_MAX] / Tau),
        number omega_n_min([OMEGA_N_RAD_S[0]] * T / Tau),
        gain omega_n_per_current(MotJGcm2, OmegaN * [1.0 / FOLLOWING_SHARE] / LimitA * UnitA),
        number omega_n_following(OmegaN),
        number omega_n_max([OMEGA_N_RAD_S[1]] * T / Tau max OmegaN),
        factor smoothing(PwmFreqHz, [SMOOTHING_RAD_S] * T),
    });
    place.xi_nominal = INVERSE_FLUX_NOMINAL;
    // The stated flux is 2/π.
    place.quarter_per_flux = Multiplier::from_bits(EIGHTH_PI.to_bits());
}

/// Sets up the adaptive back-EMF observer: (6), (7), (20), (22), (28).
fn back_emf(p: &Si, place: &mut back_emf::Config) {
    p.set(Quantity::Decay, settled(value!(p, ROverL * T)));
    place.delay = p.board.delay;
    fill!(p, place, {
        // The time for which a constant derivative acts in a period: (1 − e^(−R·T_s/L))·L/R.
        define ActsS(Decay / ROverL),
        gain decay(MotRMohm, Decay),
        gain admittance(MotLUh, ActsS / L * CurrentPerVoltage),
        gain rotation(MotLUh, ActsS * RadPerUnit),
        // λ² + (R/L + k_p)·λ + k_i/L with both poles at (−1 ± i)/ε (20).
        define KP([2.0] * CurrentRadS - ROverL),
        gain k_p(CtlBwCurHz, KP * ActsS),
        gain k_i(CtlBwCurHz, [2.0] * L * CurrentRadS * CurrentRadS * T / CurrentPerVoltage),
        // λ² + χ·k_η·λ + χ²·γ with both poles at (−1 ± i)·s (22).
        define Chi(LinearisedRadS * Flux),
        define ChiSquare(Chi * Chi),
        define PoleRadS([ATTITUDE_SHARE] * CurrentRadS),
        gain k_eta(CtlBwCurHz, [2.0] * PoleRadS / Chi * UnitV / RadPerUnit),
        gain gamma(
            CtlBwCurHz,
            [2.0] * PoleRadS * PoleRadS / ChiSquare * T * UnitV / UnitPerWb
        ),
        gain k_f(CtlBwCurHz, [FILTER_SHARE] * CurrentRadS * T),
    });
    place.xi_nominal = INVERSE_FLUX_NOMINAL;
    place.xi_min = INVERSE_FLUX_NOMINAL / 2;
    // Twice the nominal is one bit more than the type holds.
    place.xi_max = InverseFlux::MAX;
    if p.chosen(CtlObsCure::Cured) {
        let cure = place.cure.insert(Cure::default());
        // The loop that cures the published observer.
        fill!(p, cure, {
            define OmegaN([CURE_RAD_S] * T),
            gain proportional(CtlObsCure, [2.0] * OmegaN / Tau),
            gain integral(CtlObsCure, OmegaN * OmegaN / Tau),
        });
    }
}
