//! The adaptive back-EMF observer of the first paper: (6), (7), wrap (25) and filter (28).
//!
//! Forward Euler, and the matrix exponential for the estimated currents, as its section V says.

use fixed::types::extra::{U28, U32};

use super::Estimate;
use crate::control::delay::Delay;
use crate::control::transform::Dq;
use crate::math::{Gain, TopProduct, magnitude};
use crate::units::{Angle, Current, InverseFlux, Speed, Voltage};

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Voltage commanded to voltage applied.
    pub delay: Delay,
    /// 1 − e^(−R·T_s/L).
    pub decay: Gain<U28, U28>,
    /// Voltage to current: (1 − e^(−R·T_s/L))/R.
    pub admittance: Gain<U28, U28>,
    /// Speed times current to current: (1 − e^(−R·T_s/L))·L/R.
    pub rotation: Gain<U28, U28>,
    /// k_p.
    pub k_p: Gain<U28, U28>,
    /// k_i.
    pub k_i: Gain<U28, U28>,
    /// k_η.
    pub k_eta: Gain<U28, U32>,
    /// γ.
    pub gamma: Gain<U28, U32>,
    /// k_f.
    pub k_f: Gain<U32, U32>,
    /// Inverse of the flux that the parameters state.
    pub xi_nominal: InverseFlux,
    /// Least ξ̂: a flux twice the stated one.
    pub xi_min: InverseFlux,
    /// Greatest ξ̂: half the stated flux.
    pub xi_max: InverseFlux,
}

/// What the observer remembers from period to period.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// θ̂ at this sample; the type wraps it (25).
    pub theta: Angle,
    /// î at this sample, as the last period predicted it.
    pub i: Dq<Current>,
    /// ĥ at this sample.
    pub h: Dq<Voltage>,
    /// ξ̂.
    pub xi: InverseFlux,
    /// ω̂_f of the filter (28).
    pub omega_f: Speed,
    /// Voltage that was commanded in the last period.
    pub u_before: Dq<Voltage>,
}

/// The speed at a sample, of (7) and (28).
#[inline(always)]
pub fn estimate(config: &Config, state: &mut State) -> Estimate {
    let length = magnitude(state.h.d, state.h.q);
    // ξ·|h| has 28 fraction bits, a speed 32. With ξ below a half and |h| up to 8 it reaches 4 turns
    // a period; above half a turn, where a speed ends, the rotor is lost anyway.
    let omega_bar = Speed::from_bits(state.xi.top(length).to_bits().min(i32::MAX >> 4) << 4);
    let omega = omega_bar.saturating_add(config.k_eta.saturating_apply(state.h.d));
    let omega_bar_step = config.k_f.apply(omega_bar.saturating_sub(state.omega_f));
    state.omega_f = state.omega_f.saturating_add(omega_bar_step);
    Estimate {
        omega,
        omega_bar,
        omega_bar_step,
        xi: state.xi,
        xi_step: config.gamma.saturating_apply(state.h.d),
    }
}

/// Takes ξ̂ on by a period, within the range in which the stated flux can be wrong. True if it
/// stands at an end of that range.
#[inline(always)]
pub fn adapt(config: &Config, state: &mut State, xi_step: InverseFlux) -> bool {
    let xi = state.xi.saturating_add(xi_step);
    state.xi = xi.max(config.xi_min).min(config.xi_max);
    state.xi != xi
}

/// Takes θ̂, î and ĥ on by a period (6).
///
/// `omega` is the speed of the frame: ω̂ when the observer leads, an imposed one during start-up.
/// `u` is the voltage that this period commands.
#[inline(always)]
pub fn advance(config: &Config, state: &mut State, omega: Speed, i: Dq<Current>, u: Dq<Voltage>) {
    let applied = config.delay.applied(u, state.u_before);
    state.u_before = u;
    let error = Dq {
        d: i.d.saturating_sub(state.i.d),
        q: i.q.saturating_sub(state.i.q),
    };
    let next = |i_hat: Current, h: Voltage, u: Voltage, cross: Current, error: Current| {
        i_hat
            .saturating_sub(config.decay.apply(i_hat))
            .saturating_add(config.admittance.saturating_apply(h.saturating_add(u)))
            .saturating_add(config.rotation.saturating_apply(cross))
            .saturating_add(config.k_p.saturating_apply(error))
    };
    state.i = Dq {
        d: next(state.i.d, state.h.d, applied.d, omega.top(i.q), error.d),
        q: next(state.i.q, state.h.q, applied.q, -omega.top(i.d), error.q),
    };
    state.h = Dq {
        d: state
            .h
            .d
            .saturating_add(config.k_i.saturating_apply(error.d)),
        q: state
            .h
            .q
            .saturating_add(config.k_i.saturating_apply(error.q)),
    };
    state.theta = state.theta.wrapping_add(omega);
}
