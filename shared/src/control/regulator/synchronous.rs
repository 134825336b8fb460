//! The synchronous current regulator of the second paper, section 1.2.5 and figure 10: one PI controller per
//! axis on the measured currents, with decoupling feed-forward.
//!
//! With each PI's zero on the winding's pole (k_i/k_p = R/L) the loop is first-order, at the bandwidth set by
//! k_p = bandwidth·L.

use siskin_units::math::{Gain, Held, Multiplier};
use siskin_units::{Current, Speed, Voltage, WideVoltage, traced, wide};

use super::reference::{Feedback, Reference};
use crate::control::inductance::Factor;
use crate::control::transform::Dq;

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// k_p, bandwidth·L.
    pub k_p: Multiplier<Current, WideVoltage>,
    /// k_i·T_s, bandwidth·R·T_s.
    pub k_i: Multiplier<Current, WideVoltage>,
    /// L: from speed to voltage over current.
    pub reactance: Gain<Speed, Voltage>,
    /// Bandwidth·T_s.
    pub rate: Multiplier<Current, Current>,
    /// 1/k_p.
    pub admittance: Gain<WideVoltage, Current>,
}

traced! {
    /// The integrators.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// The voltage integrators of d and q.
        pub sigma: Dq<WideVoltage>,
        /// The currents that the references produce in the first-order loop, used for decoupling. Unlike
        /// measured currents they are free of noise; the references themselves would couple a step into the
        /// other axis.
        pub model: Dq<Current>,
        /// ω̂·L.
        pub cross: Multiplier<Current, WideVoltage>,
    }
}

impl Config {
    /// Returns V_d and V_q of figure 10, before any limit:
    ///
    /// V_d = k_p·(i_d* − i_d) + σ_d − ω̂·L·i_q,
    /// V_q = k_p·(i_q* − i_q) + σ_q + ω̂·L·i_d + ω̂·φ̂ + u_q*,
    ///
    /// where the last i_d and i_q are the model's, and u_q* is what the speed regulator of figure 47 feeds forward,
    /// else zero.
    #[inline(always)] // in each period
    pub fn voltage(&self, state: &State, reference: &Reference, fb: &Feedback) -> Dq<WideVoltage> {
        let e = error(reference, fb);
        let model = &state.model;
        // Currents are within four units and k_p is below eight: no sum gets near 128.
        let d = self.k_p.added(state.sigma.d, e.d);
        let q = self.k_p.added(state.sigma.q, e.q);
        let forward = wide(reference.u_q).wrapping_sub(fb.h_hat.q);
        Dq {
            d: state.cross.taken(d, model.q),
            q: state.cross.added(q, model.d).wrapping_add(forward),
        }
    }

    /// Returns the i_q* at which V_q is `u_q`, whatever i_q* `reference` has.
    pub fn current_at(
        &self,
        state: &State,
        reference: &Reference,
        fb: &Feedback,
        u_q: Voltage,
    ) -> Current {
        let reference = reference.with_i_q(Current::ZERO);
        let without = self.voltage(state, &reference, fb).q;
        self.admittance.held(wide(u_q).minus(without))
    }

    /// Advances the integrators by one period.
    #[inline(always)] // in each period
    pub fn integrate(&self, state: &mut State, reference: &Reference, fb: &Feedback) {
        let e = error(reference, fb);
        let sigma = &mut state.sigma;
        sigma.d = self.k_i.added(sigma.d, e.d);
        sigma.q = self.k_i.added(sigma.q, e.q);
        let model = &mut state.model;
        model.d = self.rate.added(model.d, reference.i.d.minus(model.d));
        model.q = self.rate.added(model.q, reference.i.q.minus(model.q));
    }

    /// Takes back what the integrators and the model gained for the current that the cut-off voltage would have
    /// produced in the first-order loop.
    pub fn anti_windup(&self, state: &mut State, cut: Dq<WideVoltage>) {
        let excess = Dq {
            d: self.admittance.held(cut.d),
            q: self.admittance.held(cut.q),
        };
        let State { sigma, model, .. } = state;
        sigma.d = self.k_i.taken(sigma.d, excess.d);
        sigma.q = self.k_i.taken(sigma.q, excess.q);
        model.d = self.rate.taken(model.d, excess.d);
        model.q = self.rate.taken(model.q, excess.q);
    }

    /// Updates ω̂·L, every few periods.
    pub fn schedule_gains(&self, state: &mut State, omega: Speed, inductance: Factor) {
        // The gain's output type has 28 fraction bits, as the multiplier has.
        let product = inductance.of(self.reactance.held(omega));
        state.cross = Multiplier::from_bits(product.to_bits());
    }

    /// Presets the integrators so that the voltage is `u`.
    pub fn preset(&self, state: &mut State, u: Dq<Voltage>, reference: &Reference, fb: &Feedback) {
        self.schedule_gains(state, fb.omega, fb.inductance);
        state.model = fb.i;
        state.sigma = Dq::default();
        let without_integrators = self.voltage(state, reference, fb);
        state.sigma = Dq {
            d: wide(u.d).minus(without_integrators.d),
            q: wide(u.q).minus(without_integrators.q),
        };
    }
}

/// References minus measured currents.
#[inline(always)] // in each period
fn error(reference: &Reference, fb: &Feedback) -> Dq<Current> {
    Dq {
        d: reference.i.d.minus(fb.i.d),
        q: reference.i.q.minus(fb.i.q),
    }
}
