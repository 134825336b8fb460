//! Coefficients of the current regulators.

use super::formula::{define, fill};
use super::si::Si;
use crate::control::regulator::{Config, modified, observer_based, synchronous};
use crate::params::choice::CtlRegulator;
use crate::parts;

/// Second pole of the current regulator over the first (21): Table III has −2357 and −2142, a ratio
/// of 0.909.
const SECOND_POLE_SHARE: f32 = 0.909;

/// Sets up the regulator that `CTL_REGULATOR` selects.
pub(super) fn regulator(p: &Si, place: &mut Config) {
    match p.choice() {
        CtlRegulator::ObserverBased => {
            if let Some(part) = parts::BackEmf::get() {
                *place = Config::ObserverBased(observer_based::Config::default(), part);
            }
        }
        CtlRegulator::Synchronous => *place = Config::Synchronous(synchronous::Config::default()),
        CtlRegulator::Modified => {
            if let Some(part) = parts::Modified::get() {
                *place = Config::Modified(modified::Config::default(), part);
            }
        }
    }
    match place {
        Config::ObserverBased(place, _) => observer_based(p, place),
        Config::Synchronous(place) => synchronous(p, place),
        Config::Modified(place, _) => modified(p, place),
    }
}

/// Sets up the observer-based regulator: (10), (21).
fn observer_based(p: &Si, place: &mut observer_based::Config) {
    const BOTH_POLES: f32 = 1.0 + SECOND_POLE_SHARE;
    fill!(p, place, {
        // λ² + (R/L + k_pe)·λ + k_ie/L with poles at −1/ε and −0.909/ε (21).
        define KP([BOTH_POLES] * CurrentRadS - ROverL),
        // R + L·k_pe, the sum of both poles times L.
        define SlopeV([BOTH_POLES] * CurrentRadS * L * VoltagePerCurrent),
        gain resistance(MotRMohm, R * VoltagePerCurrent),
        gain reactance(MotLUh, L * UnitA / UnitV * Tau / T),
        gain inductance(MotLUh, L * VoltagePerCurrent / T),
        gain k_pe(CtlBwCurHz, L * KP * VoltagePerCurrent),
        gain k_ie(
            CtlBwCurHz,
            [SECOND_POLE_SHARE] * L * CurrentRadS * CurrentRadS * T * VoltagePerCurrent
        ),
        gain admittance(CtlBwCurHz, [1.0] / SlopeV),
    });
}

/// Sets up the synchronous regulator of the second paper's figure 10: the PI's zero cancels the
/// winding's pole.
fn synchronous(p: &Si, place: &mut synchronous::Config) {
    define_pi(p);
    fill!(p, place, {
        factor k_p(CtlBwCurHz, KP),
        factor k_i(CtlBwCurHz, KI),
        gain reactance(MotLUh, L * UnitA / UnitV * Tau / T),
        factor rate(CtlBwCurHz, CurrentRadS * T),
        gain admittance(CtlBwCurHz, [1.0] / KP),
    });
}

/// Sets up the modified regulator of the second paper's figure 11: the same PI for the magnitude,
/// and for the phase divided by the greatest magnitude.
fn modified(p: &Si, place: &mut modified::Config) {
    define_pi(p);
    fill!(p, place, {
        // One over the back-EMF, in the control's unit, in turns.
        define EmfTurns(FastestRadS * Flux * Tau),
        define TurnsPerVoltage(UnitV / EmfTurns),
        gain k_p(CtlBwCurHz, KP),
        gain k_i(CtlBwCurHz, KI),
        gain phase_k_p(CtlRpmMax, KP * TurnsPerVoltage),
        gain phase_k_i(CtlRpmMax, KI * TurnsPerVoltage),
        gain admittance(CtlBwCurHz, [1.0] / KP),
    });
}

/// Defines a PI controller's gains, current to voltage: k_p = bandwidth·L, k_i = bandwidth·R.
fn define_pi(p: &Si) {
    define!(p, {
        KP(CurrentRadS * L * VoltagePerCurrent),
        KI(CurrentRadS * R * T * VoltagePerCurrent),
    });
}
