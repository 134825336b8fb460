//! The observer-based current regulator of the first paper (10).

use fixed::types::extra::U28;

use super::{Feedback, Reference};
use crate::control::transform::Dq;
use crate::math::{Gain, TopProduct};
use crate::units::{Current, Voltage};

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// R.
    pub resistance: Gain<U28, U28>,
    /// L, for speed times current.
    pub reactance: Gain<U28, U28>,
    /// L/T_s, for a current's step in a period.
    pub inductance: Gain<U28, U28>,
    /// L·k_pe.
    pub k_pe: Gain<U28, U28>,
    /// k_ie·T_s.
    pub k_ie: Gain<U28, U28>,
}

/// The integrators.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// σ_d and σ_q.
    pub sigma: Dq<Voltage>,
}

/// The voltage that brings the estimated currents to (0, i_q*), before any limit (10).
#[inline(always)]
pub fn voltage(config: &Config, state: &State, wanted: Reference, fb: &Feedback) -> Dq<Voltage> {
    let e = error(wanted, fb);
    let cross_d = fb.omega.top(fb.i.q);
    let cross_q = fb.omega.top(fb.i.d);
    Dq {
        d: state
            .sigma
            .d
            .saturating_sub(fb.h_hat.d)
            .saturating_add(config.resistance.saturating_apply(wanted.i.d))
            .saturating_sub(config.reactance.saturating_apply(cross_d))
            .saturating_sub(config.k_pe.saturating_apply(e.d)),
        q: state
            .sigma
            .q
            .saturating_sub(fb.h_hat.q)
            .saturating_add(config.resistance.saturating_apply(wanted.i.q))
            .saturating_add(config.reactance.saturating_apply(cross_q))
            .saturating_add(config.inductance.saturating_apply(wanted.i_q_step))
            .saturating_sub(config.k_pe.saturating_apply(e.q)),
    }
}

/// Takes the integrators on by a period. They stand still while the voltage is limited.
#[inline(always)]
pub fn integrate(config: &Config, state: &mut State, wanted: Reference, fb: &Feedback) {
    let e = error(wanted, fb);
    let sigma = &mut state.sigma;
    sigma.d = sigma.d.saturating_sub(config.k_ie.saturating_apply(e.d));
    sigma.q = sigma.q.saturating_sub(config.k_ie.saturating_apply(e.q));
}

/// e_d and e_q: the estimated currents against their references.
#[inline(always)]
fn error(wanted: Reference, fb: &Feedback) -> Dq<Current> {
    Dq {
        d: fb.i_hat.d.saturating_sub(wanted.i.d),
        q: fb.i_hat.q.saturating_sub(wanted.i.q),
    }
}
