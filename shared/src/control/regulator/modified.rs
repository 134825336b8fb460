//! The modified synchronous current regulator of the second paper, section 1.2.5 and figure 11: the q-axis
//! controller sets the voltage's length V, the d-axis controller its phase δ ahead of the q axis.
//!
//! It needs neither speed, inductance nor back-EMF. The phase changes the d voltage by V·δ, so the d axis has
//! its nominal bandwidth at the highest speed, where V is largest, and less below, where there is less to
//! decouple.

use fixed::types::extra::U28;
use siskin_units::math::{Gain, Held, SinCos, TopProduct, atan2_turns, magnitude};
use siskin_units::{Angle, Current, QUARTER_TURN, Voltage, WideVoltage, traced};

use super::reference::{Feedback, Reference, excess_current};
use crate::control::transform::Dq;

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// k_p of the length, bandwidth·L.
    pub k_p: Gain<Current, Voltage>,
    /// k_i·T_s of the length, bandwidth·R·T_s.
    pub k_i: Gain<Current, Voltage>,
    /// k_p of the phase, bandwidth·L over the back-EMF at `CTL_RPM_MAX`.
    pub phase_k_p: Gain<Current, Angle>,
    /// k_i·T_s of the phase, bandwidth·R·T_s over the same back-EMF.
    pub phase_k_i: Gain<Current, Angle>,
    /// 1/k_p of the length.
    pub admittance: Gain<Voltage, Current>,
}

traced! {
    /// The integrators.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// For the length V, which is negative against a negative back-EMF.
        pub length: Voltage,
        /// For the phase δ, within a quarter turn.
        pub phase: Angle,
    }
}

impl Config {
    /// Returns the voltage of length V at phase δ ahead of q, before any limit: (−V·sin δ, V·cos δ).
    pub fn voltage(&self, state: &State, reference: &Reference, fb: &Feedback) -> Dq<Voltage> {
        let length = self.length(state, reference, fb);
        let e_d = with_sign_of(length, fb.i.d.minus(reference.i.d));
        let phase = within_quarter_turn(state.phase.plus(self.phase_k_p.held(e_d)));
        let SinCos { cos, sin } = SinCos::of(phase);
        // 28 + 31 − 32 fraction bits; both components are within the length.
        Dq {
            d: -length.top(sin).scaled::<U28>(),
            q: length.top(cos).scaled(),
        }
    }

    /// V.
    fn length(&self, state: &State, reference: &Reference, fb: &Feedback) -> Voltage {
        let e_q = reference.i.q.minus(fb.i.q);
        let length = state.length.plus(self.k_p.held(e_q)).plus(reference.u_q);
        // Twice the product at the type's minimum would overflow.
        length.max(-Voltage::MAX)
    }

    /// Returns the i_q* at which the voltage has the length `u_q`, whatever i_q* `reference` has.
    pub fn current_at(
        &self,
        state: &State,
        reference: &Reference,
        fb: &Feedback,
        u_q: Voltage,
    ) -> Current {
        let reference = reference.with_i_q(Current::ZERO);
        let without = self.length(state, &reference, fb);
        self.admittance.held(u_q.minus(without))
    }

    /// Advances the integrators by one period.
    pub fn integrate(&self, state: &mut State, reference: &Reference, fb: &Feedback) {
        let step = self.k_i.held(reference.i.q.minus(fb.i.q));
        // The limit keeps the d component: while it cuts, the phase alone regulates i_d.
        let length = self.length(state, reference, fb);
        let e_d = with_sign_of(length, fb.i.d.minus(reference.i.d));
        let turn = self.phase_k_i.held(e_d);
        state.length = state.length.plus(step);
        state.phase = within_quarter_turn(state.phase.plus(turn));
    }

    /// Takes back what the length integrated for the voltage that was cut off.
    pub fn anti_windup(&self, state: &mut State, cut: Dq<WideVoltage>) {
        let excess = excess_current(self.admittance, cut);
        state.length = state.length.minus(self.k_i.held(excess.q));
    }

    /// Presets the integrators so that the voltage is `u`, which always lies within a quarter turn of the q
    /// axis with one sign or the other.
    pub fn preset(&self, state: &mut State, u: Dq<Voltage>, reference: &Reference, fb: &Feedback) {
        state.set(u);
        let length = state.length;
        let e_d = with_sign_of(length, fb.i.d.minus(reference.i.d));
        let phase = state.phase.minus(self.phase_k_p.held(e_d));
        let without = self.length(&State::default(), reference, fb);
        *state = State {
            length: length.minus(without),
            phase: within_quarter_turn(phase),
        };
    }
}

impl State {
    /// Sets length and phase from a voltage; with a negative q component the length is negative.
    fn set(&mut self, u: Dq<Voltage>) {
        let length = magnitude(u.d, u.q);
        let behind = u.q.is_negative();
        let sign = |x: Voltage| if behind { x.saturating_neg() } else { x };
        *self = Self {
            length: sign(length),
            phase: within_quarter_turn(atan2_turns(sign(u.d).saturating_neg(), sign(u.q))),
        };
    }
}

/// i_d's error as the phase sees it: a negative length flips its sign.
fn with_sign_of(length: Voltage, error: Current) -> Current {
    if length.is_negative() {
        error.saturating_neg()
    } else {
        error
    }
}

fn within_quarter_turn(phase: Angle) -> Angle {
    phase.min(QUARTER_TURN).max(-QUARTER_TURN)
}
