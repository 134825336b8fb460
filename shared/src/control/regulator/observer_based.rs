//! The observer-based current regulator of the first paper (10).

use siskin_units::math::{Gain, Held, TopProduct};
use siskin_units::{Current, CurrentRate, Voltage, WideVoltage, narrow, traced};

use super::reference::{Feedback, Reference, excess_current};
use crate::control::transform::Dq;

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// R.
    pub resistance: Gain<Current, Voltage>,
    /// L, for speed times current.
    pub reactance: Gain<CurrentRate, Voltage>,
    /// L/T_s, for a current step in one period.
    pub inductance: Gain<Current, Voltage>,
    /// L·k_pe.
    pub k_pe: Gain<Current, Voltage>,
    /// k_ie·T_s.
    pub k_ie: Gain<Current, Voltage>,
    /// 1/(R + L·k_pe).
    pub admittance: Gain<Voltage, Current>,
}

traced! {
    /// The integrators.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// σ_d and σ_q.
        pub sigma: Dq<Voltage>,
    }
}

impl Config {
    /// Returns the voltage that drives the estimated currents to (i_d*, i_q*), before any limit (10).
    pub fn voltage(&self, state: &State, reference: &Reference, fb: &Feedback) -> Dq<Voltage> {
        let u = self.without_integrators(reference, fb);
        Dq {
            d: u.d.plus(state.sigma.d),
            q: u.q.plus(state.sigma.q),
        }
    }

    /// Returns the i_q* at which the q voltage is `u_q`, whatever i_q* `reference` has.
    pub fn current_at(
        &self,
        state: &State,
        reference: &Reference,
        fb: &Feedback,
        u_q: Voltage,
    ) -> Current {
        let reference = reference.with_i_q(Current::ZERO);
        let without = self.voltage(state, &reference, fb).q;
        self.admittance.held(u_q.minus(without))
    }

    /// (10) without the integrators. Not inlined: all callers share one copy.
    #[inline(never)]
    fn without_integrators(&self, reference: &Reference, fb: &Feedback) -> Dq<Voltage> {
        let e = error(reference, fb);
        let cross_d = fb.inductance.of(fb.omega.top(fb.i.q));
        let cross_q = fb.inductance.of(fb.omega.top(fb.i.d));
        let d = self
            .resistance
            .held(reference.i.d)
            .minus(narrow(fb.h_hat.d))
            .minus(self.reactance.held(cross_d))
            .minus(self.k_pe.held(e.d));
        let q = self
            .resistance
            .held(reference.i.q)
            .minus(narrow(fb.h_hat.q))
            .plus(self.reactance.held(cross_q))
            .plus(self.inductance.held(reference.i_q_step))
            .minus(self.k_pe.held(e.q))
            .plus(reference.u_q);
        Dq { d, q }
    }

    /// Advances the integrators by one period.
    pub fn integrate(&self, state: &mut State, reference: &Reference, fb: &Feedback) {
        let e = error(reference, fb);
        let sigma = &mut state.sigma;
        sigma.d = sigma.d.minus(self.k_ie.held(e.d));
        sigma.q = sigma.q.minus(self.k_ie.held(e.q));
    }

    /// Takes back what the integrators gained for the voltage that was cut off.
    pub fn anti_windup(&self, state: &mut State, cut: Dq<WideVoltage>) {
        let excess = excess_current(self.admittance, cut);
        let sigma = &mut state.sigma;
        sigma.d = sigma.d.minus(self.k_ie.held(excess.d));
        sigma.q = sigma.q.minus(self.k_ie.held(excess.q));
    }

    /// Presets the integrators so that the voltage is `u`.
    pub fn preset(&self, state: &mut State, u: Dq<Voltage>, reference: &Reference, fb: &Feedback) {
        let without_integrators = self.without_integrators(reference, fb);
        state.sigma = Dq {
            d: u.d.minus(without_integrators.d),
            q: u.q.minus(without_integrators.q),
        };
    }
}

/// e_d and e_q: estimated currents minus references.
fn error(reference: &Reference, fb: &Feedback) -> Dq<Current> {
    Dq {
        d: fb.i_hat.d.minus(reference.i.d),
        q: fb.i_hat.q.minus(reference.i.q),
    }
}
