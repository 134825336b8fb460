//! The current regulators' coefficients.

use core::f32::consts::TAU;

use super::si::Si;
use crate::control::regulator::{Config, modified, observer_based, synchronous};
use crate::params::ParamId;
use crate::params::choice::CtlRegulator;

/// Poles of the current regulator (21): Table III has −2357 and −2142, the second at 0.909.
const SECOND_POLE_SHARE: f32 = 0.909;

/// The regulator that `CTL_REGULATOR` names.
pub(super) fn regulator(p: &Si) -> Config {
    match p.choice() {
        CtlRegulator::ObserverBased => Config::ObserverBased(observer_based(p)),
        CtlRegulator::Synchronous => Config::Synchronous(synchronous(p)),
        CtlRegulator::Modified => Config::Modified(modified(p)),
    }
}

/// (10), (21).
fn observer_based(p: &Si) -> observer_based::Config {
    let voltage_per_current = p.scale.current_a / p.scale.voltage_v;
    let r_over_l = p.resistance_ohm / p.inductance_h;
    // λ² + (R/L + k_pe)·λ + k_ie/L with poles at −1/ε and −0.909/ε (21).
    let k_pe = (1.0 + SECOND_POLE_SHARE) * p.current_rad_s - r_over_l;
    let k_ie = SECOND_POLE_SHARE * p.inductance_h * p.current_rad_s * p.current_rad_s;
    // R + L·k_pe, the sum of both poles times L.
    let slope_ohm = (1.0 + SECOND_POLE_SHARE) * p.current_rad_s * p.inductance_h;
    observer_based::Config {
        resistance: p.gain(ParamId::MotRMohm, p.resistance_ohm * voltage_per_current),
        reactance: p.gain(ParamId::MotLUh, reactance(p)),
        inductance: p.gain(
            ParamId::MotLUh,
            p.inductance_h * voltage_per_current / p.period_s,
        ),
        k_pe: p.gain(
            ParamId::CtlBwCurHz,
            p.inductance_h * k_pe * voltage_per_current,
        ),
        k_ie: p.gain(ParamId::CtlBwCurHz, k_ie * p.period_s * voltage_per_current),
        admittance: p.gain(ParamId::CtlBwCurHz, 1.0 / (slope_ohm * voltage_per_current)),
    }
}

/// Second paper, figure 10: the PI's zero on the winding's pole.
fn synchronous(p: &Si) -> synchronous::Config {
    let pi = Pi::new(p);
    synchronous::Config {
        k_p: p.factor(ParamId::CtlBwCurHz, pi.k_p),
        k_i: p.factor(ParamId::CtlBwCurHz, pi.k_i),
        reactance: p.gain(ParamId::MotLUh, reactance(p)),
        rate: p.factor(ParamId::CtlBwCurHz, p.current_rad_s * p.period_s),
        admittance: p.gain(ParamId::CtlBwCurHz, 1.0 / pi.k_p),
    }
}

/// Second paper, figure 11: the same PI for the length, and for the phase over the greatest length.
fn modified(p: &Si) -> modified::Config {
    let pi = Pi::new(p);
    let rad_s = p.get(ParamId::CtlRpmMax) * p.pole_pairs * TAU / 60.0;
    // One over the back-EMF in the control's unit, in turns.
    let turns_per_voltage = p.scale.voltage_v / (rad_s * p.flux_wb * TAU);
    modified::Config {
        k_p: p.gain(ParamId::CtlBwCurHz, pi.k_p),
        k_i: p.gain(ParamId::CtlBwCurHz, pi.k_i),
        phase_k_p: p.gain(ParamId::CtlRpmMax, pi.k_p * turns_per_voltage),
        phase_k_i: p.gain(ParamId::CtlRpmMax, pi.k_i * turns_per_voltage),
        admittance: p.gain(ParamId::CtlBwCurHz, 1.0 / pi.k_p),
    }
}

/// A PI controller's gains, current to voltage.
struct Pi {
    k_p: f32,
    k_i: f32,
}

impl Pi {
    /// k_p = bandwidth·L, k_i = bandwidth·R.
    fn new(p: &Si) -> Self {
        let voltage_per_current = p.scale.current_a / p.scale.voltage_v;
        Self {
            k_p: p.current_rad_s * p.inductance_h * voltage_per_current,
            k_i: p.current_rad_s * p.resistance_ohm * p.period_s * voltage_per_current,
        }
    }
}

/// L, speed times current to voltage.
fn reactance(p: &Si) -> f32 {
    p.inductance_h * p.scale.current_a / p.scale.voltage_v * TAU / p.period_s
}
