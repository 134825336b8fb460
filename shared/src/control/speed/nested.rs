//! The speed regulator (8) and the current reference (9) of the first paper.
//!
//! (8) leaves out feed-forward "for simplicity"; here the torque of ω̇* is added and ω* is
//! conditioned: where the current or the voltage is at its limit, ω* moves only as fast as the
//! remaining torque allows, so nothing winds up. Without inertia this is (8) as published.

use fixed::types::I0F32;
use siskin_units::math::{Gain, Held, TopProduct};
use siskin_units::{Current, Speed, Torque, Voltage, stated_torque, traced};

use super::input::Input;
use crate::control::regulator::Reference;
use crate::control::transform::Dq;
use crate::control::{PERIODS, planner};

/// Above this the error acts in full.
const ALMOST_HALF: I0F32 = I0F32::from_bits(i32::MAX - (1 << 26));

/// Coefficients for one outer-loop period, here T_s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// k_pω.
    pub k_p: Gain<Speed, Torque>,
    /// k_iω·T_s.
    pub k_i: Gain<Speed, Torque>,
    /// J/T_s: from a step of ω* to torque.
    pub inertia: Gain<Speed, Torque>,
    /// T_s/J; zero disables conditioning.
    pub inertia_inverse: Gain<Torque, Speed>,
    /// Speed to half the share of the error that is acted on, where that share is below one. At low
    /// speed an R stated too high closes a loop through the estimate, whose gain is the
    /// regulator's.
    pub trust: Gain<Speed, I0F32>,
    /// The current regulator uses p_q*, the change of i_q*.
    pub with_step: bool,
}

traced! {
    /// The integrator.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// σ_ω.
        pub sigma: Torque,
    }
}

impl Config {
    /// Returns the current that takes the speed to its reference (8), (9), within the bounds.
    ///
    /// `step` is the planner's step of ω* for this period, and `slew` its limit.
    #[inline(always)] // in the longest period
    pub(super) fn current(
        &self,
        state: &mut State,
        planner: &mut planner::State,
        (step, slew): (Speed, Speed),
        input: &Input,
    ) -> Reference {
        let slow = &input.slow_estimate;
        let reference = planner.reference.plus(step);
        let half_trust = self.trust.held(input.speed).max(I0F32::ZERO);
        let error = input.speed.minus(reference);
        let error = if half_trust < ALMOST_HALF {
            error.top(half_trust) << 1
        } else {
            error
        };
        let torque = state
            .sigma
            .minus(self.k_p.held(error))
            .plus(self.inertia.held(step));
        let integral_step = self.k_i.held(error);
        let i_q = slow.xi.top(torque);
        let bounded = input.bounds.hold(i_q);
        if bounded != i_q || input.i_q_shortfall != Current::ZERO {
            let over = i_q.minus(bounded).plus(input.i_q_shortfall);
            let step = self.anti_windup(state, (step, slew), over, integral_step);
            planner.advance(step);
            return Reference::steady(bounded);
        }
        planner.advance(step);
        state.sigma = state.sigma.minus(integral_step);
        if !self.with_step {
            return Reference::steady(i_q);
        }
        // ω̈* is left out: at the trajectory's corners it would be a voltage pulse.
        let periods = PERIODS as i32;
        let torque_step = self
            .k_p
            .held((step / periods).minus(slow.omega_bar_step))
            .minus(integral_step / periods);
        Reference {
            i: Dq {
                d: Current::ZERO,
                q: i_q,
            },
            u_q: Voltage::ZERO,
            i_q_step: slow.xi_step.top(torque).plus(slow.xi.top(torque_step)),
        }
    }

    /// Returns the step of ω* that the remaining torque can follow when the current `over` is
    /// unavailable. The error then continues as if nothing were limited, and so may the integrator,
    /// unless that step exceeds the slew.
    #[cold]
    fn anti_windup(
        &self,
        state: &mut State,
        (step, slew): (Speed, Speed),
        over: Current,
        integral_step: Torque,
    ) -> Speed {
        let less = self.inertia_inverse.held(stated_torque(over));
        let free = step.minus(less);
        let taken = free.min(slew).max(-slew);
        let conditioned = taken == free && self.inertia_inverse != Gain::ZERO;
        let pushes_further = over.is_positive() == integral_step.is_negative();
        if conditioned || !pushes_further {
            state.sigma = state.sigma.minus(integral_step);
        }
        taken
    }
}
