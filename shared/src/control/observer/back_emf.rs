//! The adaptive back-EMF observer of the first paper: (6), (7), wrap (25) and filter (28).
//!
//! Forward Euler, with the matrix exponential for the estimated currents, as the paper's section V
//! has it.

use fixed::types::I4F28;
use fixed::types::extra::U28;
use siskin_params::Delay;
use siskin_units::dimension::TurnPerPeriod;
use siskin_units::math::{
    Gain, Held, Quantity, SinCos, TopProduct, atan2_turns, divide, magnitude,
};
use siskin_units::{
    Angle, Current, CurrentRate, Flux, InverseFlux, Speed, Voltage, stated_emf, traced,
};

use super::{Estimate, SlowEstimate};
use crate::control::regulator::Feedback;
use crate::control::transform::{Dq, rotate_frame};

/// Half a turn per period, the maximum of a speed.
const FASTEST: Quantity<TurnPerPeriod, U28> = Quantity::from_bits(i32::MAX >> 4);

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Delay from the commanded voltage to the applied one.
    pub delay: Delay,
    /// 1 − e^(−R·T_s/L).
    pub decay: Gain<Current, Current>,
    /// Voltage to current: (1 − e^(−R·T_s/L))/R.
    pub admittance: Gain<Voltage, Current>,
    /// Speed times current to current: (1 − e^(−R·T_s/L))·L/R.
    pub rotation: Gain<CurrentRate, Current>,
    /// k_p.
    pub k_p: Gain<Current, Current>,
    /// k_i.
    pub k_i: Gain<Current, Voltage>,
    /// k_η.
    pub k_eta: Gain<Voltage, Speed>,
    /// γ.
    pub gamma: Gain<Voltage, InverseFlux>,
    /// k_f.
    pub k_f: Gain<Speed, Speed>,
    /// Inverse of the stated flux.
    pub xi_nominal: InverseFlux,
    /// Smallest ξ̂: twice the stated flux.
    pub xi_min: InverseFlux,
    /// Largest ξ̂: half the stated flux.
    pub xi_max: InverseFlux,
    /// An alternative to (7) for the speed; `None` is the observer as published.
    pub cure: Option<Cure>,
}

/// A phase-locked loop on the direction of ĥ in place of (7); coefficients for one period.
///
/// In (7) the speed is ξ̂·|ĥ|, and what R and L stated too high add to ĥ feeds back through the
/// speed: on the bench it loses lock at 6000 rpm with L 5 % or R 15 % too high. With |ĥ| removed
/// from the speed and a constant ξ in (9) it holds with both 30 % off.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cure {
    /// 2·ω_n.
    pub proportional: Gain<I4F28, Speed>,
    /// ω_n².
    pub integral: Gain<I4F28, Speed>,
}

traced! {
    /// The observer's state from period to period.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// θ̂ at this sample; its type does the wrap (25).
        pub theta: Angle,
        /// î at this sample, predicted in the last period.
        pub i: Dq<Current>,
        /// ĥ at this sample.
        pub h: Dq<Voltage>,
        /// ξ̂.
        pub xi: InverseFlux,
        /// ω̂_f of the filter (28).
        pub omega_f: Speed,
        /// Integrator of the cure's loop.
        pub omega_i: Speed,
        /// Voltage commanded in the last period.
        pub u_before: Dq<Voltage>,
    }
}

/// Returns the observer's state for a known, or imposed, angle and speed of the frame.
pub fn begin(config: &Config, theta: Angle, omega: Speed) -> State {
    let length = stated_emf(omega);
    State {
        theta,
        h: Dq {
            d: Voltage::ZERO,
            q: -length,
        },
        xi: config.xi_nominal,
        omega_f: omega,
        omega_i: omega,
        // Without current the terminals show the back-EMF, as if it had been commanded.
        u_before: Dq {
            d: Voltage::ZERO,
            q: length,
        },
        ..State::default()
    }
}

/// Returns the speed at a sample by (7) and (28), and advances ξ̂ by one period.
///
/// With an `imposed` speed the frame does not follow the rotor, so nothing adapts. `reference_step` is the
/// change of the speed reference per period; only the cure uses it.
pub fn estimate(
    config: &Config,
    state: &mut State,
    imposed: Option<Speed>,
    reference_step: Speed,
) -> (Estimate, SlowEstimate) {
    let theta = state.theta;
    let frame = SinCos::of(theta);
    let length = magnitude(state.h.d, state.h.q);
    if let Some(cure) = &config.cure {
        return cured(config, cure, state, (theta, frame), length, reference_step);
    }
    // ξ·|h| has 28 fraction bits, a speed 32. With ξ below a half and |h| up to 8 it reaches 4
    // turns per period; above half a turn, the maximum of a speed, the rotor is lost anyway.
    let omega_bar = state.xi.top(length).min(FASTEST).scaled();
    let omega = omega_bar.plus(config.k_eta.held(state.h.d));
    let omega_bar_step = config.k_f.apply(omega_bar.minus(state.omega_f));
    state.omega_f = state.omega_f.plus(omega_bar_step);
    let xi = state.xi;
    let xi_step = config.gamma.held(state.h.d);
    let lost = imposed.is_none() && adapt(config, state, xi_step);
    let estimate = Estimate {
        theta,
        frame,
        omega,
        omega_bar,
    };
    let slow = SlowEstimate {
        omega_bar_step,
        xi,
        xi_step,
        lost,
    };
    (estimate, slow)
}

/// ω̂ = ω̂_i + 2·ω_n·ε, ω̂_i += T_s·(ω_n²·ε + ω̇*) with ε = ĥ_d/|ĥ|.
fn cured(
    config: &Config,
    cure: &Cure,
    state: &mut State,
    (theta, frame): (Angle, SinCos),
    length: Voltage,
    reference_step: Speed,
) -> (Estimate, SlowEstimate) {
    // Twelve bits of the quotient suffice for a direction: 0.01°.
    let quotient = (state.h.d.to_bits() >> 2) / (length.to_bits() >> 14).max(1);
    let epsilon = I4F28::from_bits(quotient.clamp(-1 << 12, 1 << 12) << 16);
    let before = state.omega_i;
    state.omega_i = before
        .plus(cure.integral.apply(epsilon))
        .plus(reference_step)
        .max(Speed::ZERO);
    let estimate = Estimate {
        theta,
        frame,
        omega: state.omega_i.plus(cure.proportional.apply(epsilon)),
        omega_bar: state.omega_i,
    };
    let slow = SlowEstimate {
        omega_bar_step: state.omega_i.minus(before),
        xi: config.xi_nominal,
        xi_step: InverseFlux::ZERO,
        // ĥ opposes what the frame expects, or is nearly zero.
        lost: !state.h.q.is_negative(),
    };
    (estimate, slow)
}

/// Advances ξ̂ by one period, within the range in which the stated flux may be wrong. Returns true
/// if it is at an end of that range.
fn adapt(config: &Config, state: &mut State, xi_step: InverseFlux) -> bool {
    let xi = state.xi.plus(xi_step);
    state.xi = xi.max(config.xi_min).min(config.xi_max);
    state.xi != xi
}

/// Advances θ̂, î and ĥ by one period (6).
///
/// The feedback's speed is the frame's: ω̂ when the observer leads, an imposed one during start-up.
/// `u` is the voltage commanded in this period.
pub fn advance(config: &Config, state: &mut State, fb: &Feedback, u: Dq<Voltage>) {
    let Feedback {
        omega,
        i,
        inductance,
        ..
    } = *fb;
    let applied = Dq {
        d: config.delay.applied(u.d, state.u_before.d),
        q: config.delay.applied(u.q, state.u_before.q),
    };
    state.u_before = u;
    let error = Dq {
        d: i.d.minus(state.i.d),
        q: i.q.minus(state.i.q),
    };
    let next = |i_hat: Current, h: Voltage, u: Voltage, cross: CurrentRate, error: Current| {
        i_hat
            .minus(config.decay.apply(i_hat))
            .plus(config.admittance.held(h.plus(u)))
            .plus(config.rotation.held(inductance.of(cross)))
            .plus(config.k_p.held(error))
    };
    state.i = Dq {
        d: next(state.i.d, state.h.d, applied.d, omega.top(i.q), error.d),
        q: next(state.i.q, state.h.q, applied.q, -omega.top(i.d), error.q),
    };
    state.h = Dq {
        d: state.h.d.plus(config.k_i.held(error.d)),
        q: state.h.q.plus(config.k_i.held(error.q)),
    };
    state.theta = state.theta.wrapping_add(omega.over_period());
}

/// Returns φ̂ = 1/ξ̂, with a division.
pub fn flux(state: &State) -> Flux {
    // 2^64/(2π) over ξ̂ in 2^-32: sixteen times 28 fraction bits.
    let quotient = divide(0x28BE_60DB_9391_0544, state.xi.to_bits().max(1) as u32);
    Flux::from_bits((quotient >> 4).min(i32::MAX as u64) as i32)
}

/// Turns the frame from where an open-loop start held it to the rotor, by the back-EMF. Returns the
/// angle; `None` if the rotor has not followed.
pub fn take_over(config: &Config, state: &mut State, omega_s: Speed) -> Option<Angle> {
    let lead = rotor_lead(state.h, omega_s, config.xi_nominal)?;
    let ahead = SinCos::of(lead);
    *state = State {
        theta: state.theta.wrapping_add(lead),
        i: rotate_frame(state.i, ahead),
        h: rotate_frame(state.h, ahead),
        xi: config.xi_nominal,
        omega_f: omega_s,
        omega_i: omega_s,
        u_before: rotate_frame(state.u_before, ahead),
    };
    Some(lead)
}

/// Returns the rotor's angle from the imposed frame: θ̃ = θ − θ̂ of h = χ·(sin θ̃, −cos θ̃) (5).
///
/// `None` if the back-EMF is not between half and twice what the stated flux gives at the frame's
/// speed: the rotor has not followed, or there is none and no current answered the voltage.
fn rotor_lead(h: Dq<Voltage>, omega_s: Speed, xi_nominal: InverseFlux) -> Option<Angle> {
    // A speed has 32 fraction bits, ξ·|h| 28.
    let expected = omega_s.to_bits() >> 4;
    let found = xi_nominal.top(magnitude(h.d, h.q)).to_bits();
    let followed = found >= expected / 2 && found <= expected.saturating_mul(2);
    followed.then(|| atan2_turns(h.d, h.q.saturating_neg()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rotor_is_found_by_its_back_emf() {
        let omega = Speed::from_num(0.01);
        let xi = InverseFlux::from_num(0.25);
        // χ = ω/ξ = 0.04; the rotor leads the frame by 60°.
        let h = Dq {
            d: Voltage::from_num(0.04 * 0.866_025),
            q: Voltage::from_num(-0.04 * 0.5),
        };
        let lead = rotor_lead(h, omega, xi).expect("it has followed");
        assert!((lead.to_num::<f64>() * 360.0 - 60.0).abs() < 0.05);
        let weak = Dq {
            d: Voltage::from_num(0.015),
            q: Voltage::ZERO,
        };
        assert_eq!(rotor_lead(weak, omega, xi), None);
        let strong = Dq {
            d: Voltage::from_num(0.09),
            q: Voltage::ZERO,
        };
        assert_eq!(rotor_lead(strong, omega, xi), None);
    }
}
