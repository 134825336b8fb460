//! Coefficients of the current regulators.

use core::f32::consts::TAU;

use siskin_params::choice::CtlRegulator;
use siskin_params::{ParamId, parts};

use super::si::Si;
use crate::control::regulator::{Config, modified, observer_based, synchronous};

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
    let voltage_per_current = p.voltage_per_current;
    // λ² + (R/L + k_pe)·λ + k_ie/L with poles at −1/ε and −0.909/ε (21).
    let k_pe = BOTH_POLES * p.current_rad_s - p.r_over_l;
    let k_ie = SECOND_POLE_SHARE * p.l * p.current_rad_s * p.current_rad_s;
    // R + L·k_pe, the sum of both poles times L.
    let slope_ohm = BOTH_POLES * p.current_rad_s * p.l;
    place.resistance = p.gain(ParamId::MotRMohm, p.r * voltage_per_current);
    place.reactance = p.gain(ParamId::MotLUh, reactance(p));
    place.inductance = p.gain(ParamId::MotLUh, p.l * voltage_per_current / p.t);
    place.k_pe = p.gain(ParamId::CtlBwCurHz, p.l * k_pe * voltage_per_current);
    place.k_ie = p.gain(ParamId::CtlBwCurHz, k_ie * p.t * voltage_per_current);
    place.admittance = p.gain(ParamId::CtlBwCurHz, 1.0 / (slope_ohm * voltage_per_current));
}

/// Sets up the synchronous regulator of the second paper's figure 10: the PI's zero cancels the
/// winding's pole.
fn synchronous(p: &Si, place: &mut synchronous::Config) {
    let (k_p, k_i) = pi(p);
    place.k_p = p.factor(ParamId::CtlBwCurHz, k_p);
    place.k_i = p.factor(ParamId::CtlBwCurHz, k_i);
    place.reactance = p.gain(ParamId::MotLUh, reactance(p));
    place.rate = p.factor(ParamId::CtlBwCurHz, p.current_rad_s * p.t);
    place.admittance = p.gain(ParamId::CtlBwCurHz, 1.0 / k_p);
}

/// Sets up the modified regulator of the second paper's figure 11: the same PI for the magnitude,
/// and for the phase divided by the greatest magnitude.
fn modified(p: &Si, place: &mut modified::Config) {
    let (k_p, k_i) = pi(p);
    // One over the back-EMF, in the control's unit, in turns.
    let turns_per_voltage = p.unit_v / (p.fastest_rad_s * p.flux * TAU);
    place.k_p = p.gain(ParamId::CtlBwCurHz, k_p);
    place.k_i = p.gain(ParamId::CtlBwCurHz, k_i);
    place.phase_k_p = p.gain(ParamId::CtlRpmMax, k_p * turns_per_voltage);
    place.phase_k_i = p.gain(ParamId::CtlRpmMax, k_i * turns_per_voltage);
    place.admittance = p.gain(ParamId::CtlBwCurHz, 1.0 / k_p);
}

/// Returns a PI controller's gains, current to voltage: k_p = bandwidth·L, k_i = bandwidth·R.
fn pi(p: &Si) -> (f32, f32) {
    (
        p.current_rad_s * p.l * p.voltage_per_current,
        p.current_rad_s * p.r * p.t * p.voltage_per_current,
    )
}

/// Returns L in the control's units: a speed times it makes a voltage of a current.
fn reactance(p: &Si) -> f32 {
    p.l * p.unit_a / p.unit_v * TAU / p.t
}
