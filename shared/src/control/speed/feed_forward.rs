//! The speed regulator of the second paper, figure 47: PI on the speed, plus two feed-forwards: a current
//! proportional to the square of the commanded speed, the load of a propeller, and a voltage proportional to
//! that speed, which bypasses the current regulator.

use siskin_units::math::{Gain, Held, TopProduct};
use siskin_units::{Current, Speed, SpeedSquare, Voltage, traced};

use super::Input;
use crate::control::regulator::Reference;
use crate::control::transform::Dq;

/// Coefficients for one outer-loop period, here T_s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Proportional gain, speed to current.
    pub k_p: Gain<Speed, Current>,
    /// Integral gain times T_s.
    pub k_i: Gain<Speed, Current>,
    /// K_FFi, square of the speed to current.
    pub k_ffi: Gain<SpeedSquare, Current>,
    /// K_FFv, speed to voltage: the flux.
    pub k_ffv: Gain<Speed, Voltage>,
    /// The part of K_FFv times the measured speed that the current regulator's own feed-forward already
    /// supplies; zero for the modified one, which has none.
    pub own: Gain<Speed, Voltage>,
}

traced! {
    /// The integrator.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// The integrator's share of the current.
        pub sigma: Current,
    }
}

impl Config {
    /// Returns I_qr and the feed-forward voltage for the commanded speed ω_r after its slew limit. The
    /// integrator holds while the current is at a bound and the error pushes further.
    #[inline(always)] // in the longest period
    pub(super) fn current(&self, state: &mut State, omega_r: Speed, input: &Input) -> Reference {
        let omega = input.speed;
        let error = omega_r.minus(omega);
        let i_q = state
            .sigma
            .plus(self.k_p.held(error))
            .plus(self.propeller(omega_r));
        let bounded = input.bounds.hold(i_q);
        let over = i_q.minus(bounded).plus(input.i_q_shortfall);
        let step = self.k_i.held(error);
        if over == Current::ZERO || over.is_negative() != step.is_negative() {
            state.sigma = state.sigma.plus(step);
        }
        Reference {
            i: Dq {
                d: Current::ZERO,
                q: bounded,
            },
            i_q_step: Current::ZERO,
            u_q: self.k_ffv.held(omega_r).minus(self.own.held(omega)),
        }
    }

    /// Returns the integrator's share of a current at this speed.
    pub(super) fn remainder(&self, omega: Speed, i_q: Current) -> Current {
        i_q.minus(self.propeller(omega))
    }

    /// K_FFi·ω_r² with the speed's sign: the propeller's load.
    #[inline(always)] // in the longest period
    fn propeller(&self, omega_r: Speed) -> Current {
        let square = omega_r.top(omega_r.saturating_abs());
        self.k_ffi.held(square)
    }
}
