//! The compensated flux observer with a phase-locked loop: the default.
//!
//! A voltage model of the stator's flux in the stator's frame, held against drift by the flux that
//! the loop expects at its own angle. That leak turns with the estimate, so it displaces nothing in
//! steady state, and the speed comes from the loop alone: neither R nor L stands in its gain, as
//! they do in ω̂ = ξ̂·|ĥ| of the first paper (7), which loses its lock where they are wrong.
//!
//! In the control's units a voltage for one period is a flux, and the stated flux φ is 2/π.

use fixed::types::extra::{U28, U32};
use fixed::types::{I0F32, I1F31, I5F27};

use super::{Estimate, Input};
use crate::control::inductance::Factor;
use crate::control::transform::{AlphaBeta, Dq, to_rotor};
use crate::math::{EIGHTH_PI, Gain, Held, SinCos, TopProduct, sin_cos};
use crate::units::{Angle, Current, FLUX_NOMINAL, Flux, InverseFlux, Speed};

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// R·T_s/2, current to flux.
    pub half_resistance: Gain<U28, U28>,
    /// L, current to flux.
    pub inductance: Gain<U28, U28>,
    /// β·ω²·T_s over the speed's square. The mean of a period's current is not the mean of its two
    /// ends: without β that is 0.56° at 6000 rpm on the bench.
    pub bias: Gain<U32, U32>,
    /// Least ω⁺, the leak's corner towards standstill.
    pub omega_min: Speed,
    /// Least ω_n of the loop, in turns a period.
    pub omega_n_min: Speed,
    /// Greatest ω_n.
    pub omega_n_max: Speed,
    /// Share of a new sample in what ω̂ has above ω̂_i.
    pub smoothing: Gain<U32, U32>,
    /// ξ of the stated flux.
    pub xi_nominal: InverseFlux,
}

/// What the observer remembers from period to period.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// θ̂ at the coming sample.
    pub theta: Angle,
    /// ω̂_i, the loop's integrator.
    pub omega_i: Speed,
    /// φ̂.
    pub phi: Flux,
    /// ψ, the stator's flux.
    psi: AlphaBeta<Flux>,
    /// What ω̂ has above ω̂_i, smoothed.
    smooth: Speed,
    /// Current at the last sample.
    i_before: AlphaBeta<Current>,
}

impl Default for State {
    fn default() -> Self {
        Self {
            theta: Angle::ZERO,
            omega_i: Speed::ZERO,
            phi: FLUX_NOMINAL,
            psi: AlphaBeta::default(),
            smooth: Speed::ZERO,
            i_before: AlphaBeta::default(),
        }
    }
}

/// ω_n of the loop over ω̂.
const OMEGA_N_SHARE: I0F32 = I0F32::lit("0.35");

/// Rate of φ̂ over ω⁺, 0.15 a radian and half of that a half turn: 0.15·2π/2.
const PHI_RATE_HALF: I0F32 = I0F32::lit("0.471");

/// 1.8·2/8: twice the damping, for half of ε, an eighth of it.
const DAMPING: I0F32 = I0F32::lit("0.45");

/// The fastest leak.
const EIGHTH_TURN: Speed = Speed::from_bits(1 << 29);

/// Least and greatest φ̂ over the stated flux: 0.3 and 2.
const PHI_MIN: Flux = Flux::from_bits(51_267_396);
const PHI_MAX: Flux = Flux::from_bits(341_782_638);

/// The observer where the rotor's speed is known, and its angle at the coming sample.
pub fn begin(config: &Config, theta: Angle, omega: Speed, i: AlphaBeta<Current>) -> State {
    // ψ is that of the sample before: the voltage since then is still to be added.
    let rotor = rotor_flux(FLUX_NOMINAL, sin_cos(theta.wrapping_sub(omega)));
    let own = stator_flux(config, Factor::ONE, i);
    State {
        theta,
        omega_i: omega,
        phi: FLUX_NOMINAL,
        psi: AlphaBeta {
            alpha: rotor.alpha.plus(own.alpha),
            beta: rotor.beta.plus(own.beta),
        },
        smooth: Speed::ZERO,
        i_before: i,
    }
}

/// Takes the observer from the last sample to this one.
///
/// `imposed` is the speed that an open-loop start gives the rotor: the loop then follows its phase
/// only.
#[inline(always)]
pub fn estimate(
    config: &Config,
    state: &mut State,
    input: &Input,
    imposed: Option<Speed>,
) -> Estimate {
    let frame = sin_cos(state.theta);
    if let Some(speed) = imposed {
        state.omega_i = speed;
    }
    let omega_before = state.omega_i;
    // An eighth of a turn a period bounds the leak below one.
    let omega_plus = omega_before
        .saturating_abs()
        .max(config.omega_min)
        .min(EIGHTH_TURN);

    // ψ += T_s·u − R·T_s/2·(i_k + i_{k−1}), ψ_r = ψ − L·i.
    let drop =
        |now: Current, before: Current| config.half_resistance.saturating_apply(now.plus(before));
    let psi = AlphaBeta {
        alpha: state
            .psi
            .alpha
            .plus(input.v.alpha)
            .minus(drop(input.i.alpha, state.i_before.alpha)),
        beta: state
            .psi
            .beta
            .plus(input.v.beta)
            .minus(drop(input.i.beta, state.i_before.beta)),
    };
    state.i_before = input.i;
    let own = stator_flux(config, input.inductance, input.i);
    let psi_r = AlphaBeta {
        alpha: psi.alpha.minus(own.alpha),
        beta: psi.beta.minus(own.beta),
    };
    let z = to_rotor(psi_r, frame);

    // ψ += T_s·(β·ω⁺²·ψ_r − 0.5·ω⁺·(ψ_r − φ̂·e^{jθ̂})); half of ω⁺·T_s is π times its turns.
    let expected = rotor_flux(state.phi, frame);
    let leak = I0F32::from_bits(omega_plus.top(EIGHTH_PI).to_bits() << 3);
    let bias = config.bias.apply(omega_plus.top(omega_plus));
    let held = |psi: Flux, psi_r: Flux, expected: Flux| {
        psi.plus(psi_r.top(bias))
            .minus(psi_r.minus(expected).top(leak))
    };
    state.psi = AlphaBeta {
        alpha: held(psi.alpha, psi_r.alpha, expected.alpha),
        beta: held(psi.beta, psi_r.beta, expected.beta),
    };

    // φ̂ += 0.15·T_s·ω⁺·(z_d − φ̂).
    let off = z.d.minus(state.phi);
    let phi_step = off.top(omega_plus).top(PHI_RATE_HALF).to_bits() << 1;
    let phi = state.phi.plus(Flux::from_bits(phi_step));
    state.phi = phi.max(PHI_MIN).min(PHI_MAX);

    // ω_n = 0.35·ω̂_i; ω̂_i += T_s·ω_n²·ε, ω̂ = ω̂_i + 1.8·ω_n·ε.
    let epsilon_half = half_epsilon(z);
    let omega_n = omega_before
        .top(OMEGA_N_SHARE)
        .max(config.omega_n_min)
        .min(config.omega_n_max);
    let four_pi_omega_n = Speed::from_bits(omega_n.top(EIGHTH_PI).to_bits() << 5);
    let omega_i = omega_before.plus(four_pi_omega_n.top(omega_n).top(epsilon_half));
    if imposed.is_none() {
        state.omega_i = omega_i;
    }
    let proportional = Speed::from_bits(omega_n.top(epsilon_half).top(DAMPING).to_bits() << 3);
    let omega = state.omega_i.plus(proportional);
    // Under acceleration ω̂_i lags by 1.8·ω̇/ω_n and ω̂ does not, but ω̂ passes the noise: what it has
    // above ω̂_i is added smoothly.
    let smooth_step = config.smoothing.apply(proportional.minus(state.smooth));
    state.smooth = state.smooth.plus(smooth_step);
    let omega_bar = state.omega_i.plus(state.smooth);
    let omega_bar_step = state.omega_i.minus(omega_before).plus(smooth_step);
    let theta = state.theta;
    state.theta = theta.wrapping_add(omega);
    Estimate {
        theta,
        frame,
        omega,
        omega_bar,
        omega_bar_step,
        xi: config.xi_nominal,
        xi_step: InverseFlux::ZERO,
        lost: z.d < PHI_MIN || z.d > PHI_MAX,
    }
}

/// L·i.
#[inline(always)]
fn stator_flux(config: &Config, factor: Factor, i: AlphaBeta<Current>) -> AlphaBeta<Flux> {
    AlphaBeta {
        alpha: factor.of(config.inductance.saturating_apply(i.alpha)),
        beta: factor.of(config.inductance.saturating_apply(i.beta)),
    }
}

/// φ·e^{jθ}.
#[inline(always)]
fn rotor_flux(phi: Flux, frame: SinCos) -> AlphaBeta<Flux> {
    // φ̂ is at most twice the stated flux: a bit is free.
    let double = |x: I5F27| Flux::from_bits(x.to_bits() << 1);
    AlphaBeta {
        alpha: double(phi.top(frame.cos)),
        beta: double(phi.top(frame.sin)),
    }
}

/// ε/2: z_q over the stated flux, held at ±1, and all of that where the rotor points backwards.
#[inline(always)]
fn half_epsilon(z: Dq<Flux>) -> I0F32 {
    let most = Flux::from_bits(FLUX_NOMINAL.to_bits() - 1);
    let z_q = if z.d.is_negative() {
        if z.q.is_negative() { -most } else { most }
    } else {
        z.q.min(most).max(-most)
    };
    // z_q·π/4. Held at 2/π it is below one: three bits are free. Its product with π/8 has 31 + 32 −
    // 32 fraction bits; one more, and twice the value.
    let z_q = I1F31::from_bits(z_q.to_bits() << 3);
    I0F32::from_bits(z_q.top(EIGHTH_PI).to_bits() << 2)
}

/// The rotor's angle at the coming sample, if its flux is near the stated one.
pub fn found(state: &State) -> Option<Angle> {
    let near = state.phi > FLUX_NOMINAL / 2 && state.phi < FLUX_NOMINAL * 2 - FLUX_NOMINAL / 2;
    near.then_some(state.theta)
}

impl State {
    /// Every word of the state.
    pub fn trace(&self, out: &mut impl FnMut(u32)) {
        let Self {
            theta,
            omega_i,
            phi,
            psi,
            smooth,
            i_before,
        } = self;
        for bits in [
            theta.to_bits(),
            omega_i.to_bits(),
            phi.to_bits(),
            psi.alpha.to_bits(),
            psi.beta.to_bits(),
            smooth.to_bits(),
            i_before.alpha.to_bits(),
            i_before.beta.to_bits(),
        ] {
            out(bits as u32);
        }
    }
}

#[cfg(test)]
mod tests;
