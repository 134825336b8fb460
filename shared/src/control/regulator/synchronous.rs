//! The synchronous current regulator of the second paper, section 1.2.5 and figure 10: a PI
//! controller an axis on the measured currents, with the feed-forward that decouples the axes.
//!
//! With the zero of each PI on the winding's pole (k_i/k_p = R/L) the loop is of first order, at
//! the bandwidth that k_p = bandwidth·L sets.

use fixed::types::extra::U28;

use super::{Feedback, Reference, beyond};
use crate::control::transform::{Dq, rotate_frame};
use crate::math::{Gain, Held, SinCos, TopProduct};
use crate::units::{Current, Voltage};

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// k_p, bandwidth·L.
    pub k_p: Gain<U28, U28>,
    /// k_i·T_s, bandwidth·R·T_s.
    pub k_i: Gain<U28, U28>,
    /// L, for speed times current.
    pub reactance: Gain<U28, U28>,
    /// Bandwidth·T_s.
    pub rate: Gain<U28, U28>,
    /// 1/k_p.
    pub admittance: Gain<U28, U28>,
}

/// The integrators.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Of the voltage along d and q.
    pub sigma: Dq<Voltage>,
    /// The currents that the references bring, at the loop's first order: what is decoupled. They
    /// have no noise, and the references themselves would cross the axes at a step.
    pub model: Dq<Current>,
}

impl Config {
    /// V_d and V_q of figure 10, before any limit:
    ///
    /// V_d = k_p·(i_d* − i_d) + σ_d − ω̂·L·i_q,
    /// V_q = k_p·(i_q* − i_q) + σ_q + ω̂·L·i_d + ω̂·φ̂,
    ///
    /// where the last i_d and i_q are those of the model.
    #[inline(always)]
    pub fn voltage(&self, state: &State, wanted: &Reference, fb: &Feedback) -> Dq<Voltage> {
        let u = self.forced(state, wanted, fb);
        Dq {
            d: u.d.plus(state.sigma.d),
            q: u.q.plus(state.sigma.q),
        }
    }

    /// The current i_q* for which V_q is `u_q`; the one that is wanted does not matter.
    #[inline(always)]
    pub fn current_at(
        &self,
        state: &State,
        wanted: &Reference,
        fb: &Feedback,
        u_q: Voltage,
    ) -> Current {
        let wanted = wanted.with_i_q(Current::ZERO);
        let without = self.voltage(state, &wanted, fb).q;
        self.admittance.saturating_apply(u_q.minus(without))
    }

    /// V_d and V_q without the integrators.
    #[inline(always)]
    fn forced(&self, state: &State, wanted: &Reference, fb: &Feedback) -> Dq<Voltage> {
        let e = error(wanted, fb);
        let cross_d = fb.inductance.of(fb.omega.top(state.model.q));
        let cross_q = fb.inductance.of(fb.omega.top(state.model.d));
        let d = self
            .k_p
            .saturating_apply(e.d)
            .minus(self.reactance.saturating_apply(cross_d));
        let q = self
            .k_p
            .saturating_apply(e.q)
            .plus(self.reactance.saturating_apply(cross_q))
            .minus(fb.h_hat.q)
            .plus(wanted.u_q);
        Dq { d, q }
    }

    /// Takes the integrators on by a period, for the current that the limit has left.
    #[inline(always)]
    pub fn integrate(
        &self,
        state: &mut State,
        wanted: &Reference,
        fb: &Feedback,
        cut: Option<Dq<Voltage>>,
    ) {
        let e = error(wanted, fb);
        let step = |e: Current, beyond| self.k_i.saturating_apply(e.minus(beyond));
        let beyond = beyond(self.admittance, cut);
        let sigma = &mut state.sigma;
        sigma.d = sigma.d.plus(step(e.d, beyond.d));
        sigma.q = sigma.q.plus(step(e.q, beyond.q));
        let model = &mut state.model;
        let follow = |model: Current, wanted: Current, beyond| {
            let left = wanted.minus(beyond).minus(model);
            model.plus(self.rate.apply(left))
        };
        model.d = follow(model.d, wanted.i.d, beyond.d);
        model.q = follow(model.q, wanted.i.q, beyond.q);
    }

    /// Sets the integrators so that the voltage is `u`.
    pub fn begin(&self, state: &mut State, u: Dq<Voltage>, wanted: &Reference, fb: &Feedback) {
        state.model = fb.i;
        let forced = self.forced(state, wanted, fb);
        state.sigma = Dq {
            d: u.d.minus(forced.d),
            q: u.q.minus(forced.q),
        };
    }
}

impl State {
    /// Turns the integrators with the frame.
    pub fn rotate(&mut self, ahead: SinCos) {
        self.sigma = rotate_frame(self.sigma, ahead);
        self.model = rotate_frame(self.model, ahead);
    }
}

/// The references against the measured currents.
#[inline(always)]
fn error(wanted: &Reference, fb: &Feedback) -> Dq<Current> {
    Dq {
        d: wanted.i.d.minus(fb.i.d),
        q: wanted.i.q.minus(fb.i.q),
    }
}
