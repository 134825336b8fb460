//! The speed regulator (8) and the current reference (9) of the first paper.

use fixed::types::extra::{U28, U32};

use super::observer::Estimate;
use super::regulator::Reference;
use super::transform::Dq;
use crate::math::{Gain, TopProduct};
use crate::units::{Current, Speed, Torque, Voltage};

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// k_pω.
    pub k_p: Gain<U32, U28>,
    /// k_iω·T_s.
    pub k_i: Gain<U32, U28>,
}

/// The integrator.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// σ_ω.
    pub sigma: Torque,
}

/// Bounds of i_q*; by default no current.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounds {
    /// Least i_q*, at most zero: what braking may return.
    pub min: Current,
    /// Greatest i_q*.
    pub max: Current,
}

/// The current that takes the speed to its reference (8), (9).
///
/// `reference` is ω* and `reference_step` ω̇*·T_s. The integrator stands still while the current is
/// at a bound and the error pushes it further.
#[inline(always)]
pub fn current(
    config: &Config,
    state: &mut State,
    (reference, reference_step): (Speed, Speed),
    estimate: &Estimate,
    bounds: Bounds,
) -> Reference {
    let error = estimate.omega_bar.saturating_sub(reference);
    let torque = state
        .sigma
        .saturating_sub(config.k_p.saturating_apply(error));
    let integral_step = config.k_i.saturating_apply(error);
    let i_q = estimate.xi.top(torque);
    let bounded = i_q.min(bounds.max).max(bounds.min);
    if bounded == i_q {
        state.sigma = state.sigma.saturating_sub(integral_step);
        let torque_step = config
            .k_p
            .saturating_apply(reference_step.saturating_sub(estimate.omega_bar_step))
            .saturating_sub(integral_step);
        Reference {
            i: Dq {
                d: Current::ZERO,
                q: i_q,
            },
            u_q: Voltage::ZERO,
            i_q_step: estimate
                .xi_step
                .top(torque)
                .saturating_add(estimate.xi.top(torque_step)),
        }
    } else {
        saturated(state, bounded, i_q, integral_step)
    }
}

#[cold]
fn saturated(
    state: &mut State,
    bounded: Current,
    i_q: Current,
    integral_step: Torque,
) -> Reference {
    let pushes_further = (i_q > bounded) == integral_step.is_negative();
    if !pushes_further {
        state.sigma = state.sigma.saturating_sub(integral_step);
    }
    Reference::steady(bounded)
}
