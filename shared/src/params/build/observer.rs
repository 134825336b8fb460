//! The observers' coefficients.

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
use crate::units::{INVERSE_FLUX_NOMINAL, InverseFlux};

/// Poles of the attitude observer (22) over the current bandwidth: Table III has 425.6 against
/// 2357 1/s.
const ATTITUDE_SHARE: f32 = 0.1806;

/// k_f over the current bandwidth: 500 against 2357 1/s (section V).
const FILTER_SHARE: f32 = 0.2121;

/// ω_n of the loop that cures the published observer, 1/s.
const CURE_RAD_S: f32 = 400.0;

/// ω⁺ at the least, 1/s.
const OMEGA_MIN_RAD_S: f32 = 60.0;

/// Least and greatest ω_n of the loop, 1/s, where what follows the current is less.
const OMEGA_N_RAD_S: [f32; 2] = [150.0, 1000.0];

/// ω_n over the root of what `LIM_PHASE_A` accelerates the rotor by, rad/s²: the loop then lags by 1/2² of a radian,
/// 14°. Slower, a rotor that is light for its speed would leave it behind.
const FOLLOWING: f32 = 2.0;

/// The current that asks for all of that, of `LIM_PHASE_A`; of less, ω_n is in proportion, and the loop lags by no
/// more down to a 25th of the limit.
const FOLLOWING_SHARE: f32 = 0.2;

/// Up to `LIM_PHASE_A` the current's bound rises with the speed (`TORQUE_DROP_SHARE`), and ω_n with it
/// (`compensated::OMEGA_N_SHARE`): where it has caught up with what such a current needs, no more is needed.
const CAUGHT_UP: f32 = TORQUE_DROP_SHARE / 0.35;

/// ω_n over the PWM's frequency, at most: the loop goes in steps.
const OMEGA_N_SHARE_MAX: f32 = 0.05;

/// Corner of the speed's part above the loop's integrator, 1/s.
const SMOOTHING_RAD_S: f32 = 300.0;

/// Flux of a unit of current, in units of flux: with up to a unit and a half of current the stator's
/// flux stays within the eight units of its type. That is L·i of 9.4 times the stated flux at the end
/// of the converter's range.
const INDUCTANCE_MAX: f32 = 4.0;

/// The observer that `CTL_OBSERVER` names.
pub(super) fn observer(p: &Si, place: &mut observer::Config) {
    match p.choice() {
        CtlObserver::BackEmf => *place = observer::Config::BackEmf(back_emf::Config::default()),
        CtlObserver::FluxCrossings | CtlObserver::Hall => {
            *place = observer::Config::Edges(edges::Config::default());
        }
        CtlObserver::Compensated => {
            *place = observer::Config::Compensated(compensated::Config::default());
        }
    }
    match place {
        observer::Config::BackEmf(place) => back_emf(p, place),
        observer::Config::Edges(place) => flux::edges(p, place),
        observer::Config::Compensated(place) => compensated(p, place),
        observer::Config::Given => {}
    }
}

/// The compensated flux observer.
fn compensated(p: &Si, place: &mut compensated::Config) {
    let formulas = formulas!(p, {
        value own_flux(L * FluxPerCurrent),
        // The square of ω_n over the current.
        define Following([1.5 * FOLLOWING * FOLLOWING] * PolePairs * PolePairs * Flux / J),
        value following(Following * LimitA),
    });
    p.refuse_if(
        formulas.value() >= INDUCTANCE_MAX,
        ParamId::MotLUh,
        "too high for this flux and the board's range",
    );
    p.set(Quantity::OmegaN, square_root(formulas.value()));
    // Under a voltage that changes in the middle of the period β is half, the other way.
    let share = match p.board.delay {
        Delay::None | Delay::One => 1.0,
        Delay::Half => -0.5,
    };
    p.set(Quantity::Share, share);
    fill!(p, place, {
        factor half_resistance(MotRMohm, [0.5] * R * T * FluxPerCurrent),
        factor inductance(MotLUh, L * FluxPerCurrent),
        // β = R·T_s²/(12·L). The square of the speed is in turns a period.
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

/// The adaptive back-EMF observer (6), (7), (20), (22), (28).
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
