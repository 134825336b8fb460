//! The compensated flux observer with a phase-locked loop: the default.
//!
//! A voltage model of the stator flux in the stator's frame, held against drift by the flux that the loop expects
//! at its own angle. This leak rotates with the estimate, so it causes no steady-state error, and the speed comes
//! from the loop alone: neither R nor L enters its gain, as they do in ω̂ = ξ̂·|ĥ| of the first paper (7), which
//! loses lock when they are wrong.
//!
//! In the control's units a voltage applied for one period is a flux, and the stated flux φ is 2/π.
#![doc = include_str!("compensated/derivation.md")]

use fixed::types::extra::{U27, U29};
use fixed::types::{I0F32, I5F27};
use siskin_units::dimension::Weber;
use siskin_units::math::{
    EIGHTH_PI, Gain, Held, Multiplier, Quantity, SinCos, TopProduct, TopSum, sin_cos,
};
use siskin_units::{
    Angle, Current, FLUX_NOMINAL, Flux, InverseFlux, Speed, SpeedSquare, Voltage, WideFlux,
    WideVoltage, traced,
};

use super::{Estimate, Input, SlowEstimate};
use crate::control::inductance::Factor;
use crate::control::transform::{AlphaBeta, Dq};

/// A flux along an axis of the estimated frame; the sine uses one fraction bit.
type Component = Quantity<Weber, U27>;

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// R·T_s/2, from current to flux.
    pub half_resistance: Multiplier<Current, Flux>,
    /// L, from current to flux.
    pub inductance: Multiplier<Current, WideFlux>,
    /// β·ω²·T_s over the square of the speed. A period's mean current is not the mean of its end points: without β
    /// the error is 0.56° at 6000 rpm on the bench.
    pub bias: Gain<SpeedSquare, I0F32>,
    /// Smallest ω⁺, the leak's corner towards standstill.
    pub omega_min: Speed,
    /// Smallest ω_n of the loop, in turns per period.
    pub omega_n_min: Speed,
    /// Smallest ω_n per current along q, which accelerates the rotor.
    pub omega_n_per_current: Gain<Current, Speed>,
    /// Largest value this current-dependent floor reaches.
    pub omega_n_following: Speed,
    /// Largest ω_n.
    pub omega_n_max: Speed,
    /// Weight of a new sample in the smoothed ω̂ − ω̂_i.
    pub smoothing: Multiplier<Speed, Speed>,
    /// ξ of the stated flux.
    pub xi_nominal: InverseFlux,
    /// A quarter over the stated flux, from the q component to ε.
    pub quarter_per_flux: Multiplier<Component, I5F27>,
}

traced! {
    /// State of the observer.
    #[derive(Clone, Debug, PartialEq)]
    pub struct State {
        /// θ̂ at the next sample.
        pub theta: Angle,
        /// ω̂_i, the loop's integrator.
        pub omega_i: Speed,
        /// φ̂.
        pub phi: Flux,
        /// ψ, the stator flux.
        psi: AlphaBeta<Flux>,
        /// ω̂ − ω̂_i, smoothed.
        excess: Speed,
        /// Current at the last sample.
        i_before: AlphaBeta<Current>,
        /// Coefficients at the present speed.
        gains: Gains,
    }
}

traced! {
    /// Coefficients that follow the speed and the inductance; [`schedule_gains`] updates them every few periods.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    struct Gains {
        /// L, including its adaptation.
        inductance: Multiplier<Current, WideFlux>,
        /// 0.5·ω⁺·T_s.
        leak: I0F32,
        /// 0.5·ω⁺·T_s − β·ω⁺²·T_s.
        leak_less_bias: I0F32,
        /// Rate of φ̂, 0.15·ω⁺·T_s.
        phi_rate: I0F32,
        /// ω_n²·T_s, for half of ε.
        integral: Speed,
        /// 1.8·ω_n, for half of ε.
        proportional: Speed,
        /// φ̂, from speed to back-EMF.
        emf: Multiplier<Speed, WideVoltage>,
        /// ω̄̂ at the last update.
        omega_bar: Speed,
    }
}

impl Default for State {
    fn default() -> Self {
        Self {
            theta: Angle::ZERO,
            omega_i: Speed::ZERO,
            phi: FLUX_NOMINAL,
            psi: AlphaBeta::default(),
            excess: Speed::ZERO,
            i_before: AlphaBeta::default(),
            gains: Gains::default(),
        }
    }
}

/// ω_n of the loop over ω̂.
const OMEGA_N_SHARE: I0F32 = I0F32::lit("0.35");

/// Rate of φ̂ over ω⁺: 0.15 per radian, per half turn half of that: 0.15·2π/2.
const PHI_RATE_HALF: I0F32 = I0F32::lit("0.471");

/// 1.8·2/8: twice the damping ratio, for half of ε, scaled by an eighth.
const DAMPING: I0F32 = I0F32::lit("0.45");

/// The fastest leak.
const EIGHTH_TURN: Speed = Speed::from_bits(1 << 29);

/// Smallest and largest φ̂ over the stated flux: 0.3 and 2.
const PHI_MIN: Flux = Flux::from_bits(51_267_396);
const PHI_MAX: Flux = Flux::from_bits(341_782_638);

/// φ̂ over the stated flux below which the rotor counts as lost: 0.4. A stopped rotor leaves only the error of R
/// times its current, which keeps φ̂ near its minimum, with z_d alternating above and below it.
const PHI_LOST: Flux = Flux::from_bits(68_356_528);

/// Begins with a known rotor speed, and its angle at the next sample. Keeps the coefficients: Park has set those of
/// a rotor at rest, and for a caught one [`schedule_gains`] sets them afterwards.
pub fn begin(
    config: &Config,
    state: &mut State,
    (theta, omega): (Angle, Speed),
    i: AlphaBeta<Current>,
) {
    // ψ belongs to the previous sample: the voltage since then is still to be added.
    let rotor = rotor_flux(
        FLUX_NOMINAL,
        sin_cos(theta.wrapping_sub(omega.over_period())),
    );
    let armature = stator_flux(config.inductance, i);
    *state = State {
        theta,
        omega_i: omega,
        psi: AlphaBeta {
            alpha: rotor.alpha.plus(armature.alpha),
            beta: rotor.beta.plus(armature.beta),
        },
        i_before: i,
        gains: state.gains,
        ..State::default()
    };
}

/// Updates the coefficients that follow the speed and the requested q current, every few periods.
pub fn schedule_gains(config: &Config, state: &mut State, inductance: Factor, i_q: Current) {
    state.phi = state.phi.max(PHI_MIN).min(PHI_MAX);
    let omega = state.omega_i;
    // An eighth of a turn per period keeps the leak below one.
    let omega_plus = omega
        .saturating_abs()
        .max(config.omega_min)
        .min(EIGHTH_TURN);
    // Half of ω⁺·T_s is π times its turns.
    let leak = omega_plus.turns().top(EIGHTH_PI) << 3;
    // Fast where the rotor may accelerate. At idle the back-EMF tells little about the rotor, and a loop faster
    // than its rotation would oscillate on the angle error from the dead times' signs.
    let following = config
        .omega_n_per_current
        .held(i_q.abs())
        .min(config.omega_n_following);
    let omega_n = omega
        .top(OMEGA_N_SHARE)
        .max(config.omega_n_min)
        .max(following)
        .min(config.omega_n_max);
    let four_pi_omega_n = omega_n.top(EIGHTH_PI) << 5;
    state.gains = Gains {
        inductance: inductance.multiplied(config.inductance),
        leak,
        leak_less_bias: leak.minus(config.bias.apply(omega_plus.top(omega_plus))),
        phi_rate: omega_plus.turns().top(PHI_RATE_HALF) << 1,
        integral: four_pi_omega_n.top(omega_n).over_period(),
        proportional: omega_n.top(DAMPING) << 3,
        // A speed in turns takes 2π: 16·π/8, and a voltage with 24 fraction bits accounts for a sixteenth.
        emf: Multiplier::from_bits(state.phi.top(EIGHTH_PI).to_bits()),
        omega_bar: state.omega_bar(),
    };
}

/// Advances the observer from the last sample to this one.
///
/// `imposed` is the speed that an open-loop start imposes on the rotor: the loop then tracks only the phase.
#[inline(always)] // in each period
pub fn estimate(
    config: &Config,
    state: &mut State,
    input: &Input,
    imposed: Option<Speed>,
) -> Estimate {
    let frame = sin_cos(state.theta);
    let gains = &state.gains;
    if let Some(speed) = imposed {
        state.omega_i = speed;
    }

    // ψ += T_s·u − R·T_s/2·(i_k + i_{k−1}), ψ_r = ψ − L·i.
    let psi_step = |v: Voltage, now: Current, before: Current| {
        config
            .half_resistance
            .taken(v.over_period(), now.plus(before))
    };
    let psi = AlphaBeta {
        alpha: state
            .psi
            .alpha
            .plus(psi_step(input.v.alpha, input.i.alpha, state.i_before.alpha)),
        beta: state
            .psi
            .beta
            .plus(psi_step(input.v.beta, input.i.beta, state.i_before.beta)),
    };
    state.i_before = input.i;
    let armature = stator_flux(gains.inductance, input.i);
    let psi_r = AlphaBeta {
        alpha: psi.alpha.minus(armature.alpha),
        beta: psi.beta.minus(armature.beta),
    };
    // 28 + 31 − 32 fraction bits.
    let z: Dq<Component> = Dq {
        d: psi_r.alpha.top(frame.cos).plus_top(psi_r.beta, frame.sin),
        q: psi_r.beta.top(frame.cos).minus_top(psi_r.alpha, frame.sin),
    };
    let z_d = Flux::from_bits(z.d.plus(z.d).to_bits());

    // ψ += T_s·(β·ω⁺²·ψ_r − 0.5·ω⁺·(ψ_r − φ̂·e^{jθ̂})). The leak is below a half, which frees one bit.
    let toward_rotor: Quantity<Weber, U29> = state.phi.top(gains.leak).scaled();
    state.psi = AlphaBeta {
        alpha: psi
            .alpha
            .minus_top(psi_r.alpha, gains.leak_less_bias)
            .plus_top(toward_rotor, frame.cos),
        beta: psi
            .beta
            .minus_top(psi_r.beta, gains.leak_less_bias)
            .plus_top(toward_rotor, frame.sin),
    };

    // φ̂ += 0.15·T_s·ω⁺·(z_d − φ̂).
    let phi_error = z_d.minus(state.phi);
    state.phi = state.phi.plus_top(phi_error, gains.phi_rate);

    // ω̂_i += T_s·ω_n²·ε, ω̂ = ω̂_i + 1.8·ω_n·ε.
    let epsilon_half = half_epsilon(config, z);
    if imposed.is_none() {
        state.omega_i = state.omega_i.plus(gains.integral.top(epsilon_half));
    }
    let proportional = gains.proportional.top(epsilon_half);
    let omega = state.omega_i.plus(proportional);
    // Under acceleration ω̂_i lags by 1.8·ω̇/ω_n. ω̂ does not, but passes the noise, so its excess over ω̂_i is
    // added smoothed.
    state.excess = config
        .smoothing
        .added(state.excess, proportional.minus(state.excess));
    let theta = state.theta;
    state.theta = theta.wrapping_add(omega.over_period());
    Estimate {
        theta,
        frame,
        omega,
        omega_bar: state.omega_bar(),
    }
}

/// Returns the slow part of the estimate, `periods` after [`schedule_gains`].
pub fn slow_estimate(config: &Config, state: &State, periods: u32) -> SlowEstimate {
    let change = state.omega_bar().minus(state.gains.omega_bar);
    SlowEstimate {
        omega_bar_step: change / periods as i32,
        xi: config.xi_nominal,
        xi_step: InverseFlux::ZERO,
        lost: state.phi < PHI_LOST || state.phi > PHI_MAX,
    }
}

/// Returns L·i.
#[inline(always)] // in each period
fn stator_flux(
    inductance: Multiplier<Current, WideFlux>,
    i: AlphaBeta<Current>,
) -> AlphaBeta<Flux> {
    let flux = |i: Current| inductance.of(i).scaled();
    AlphaBeta {
        alpha: flux(i.alpha),
        beta: flux(i.beta),
    }
}

/// Returns φ·e^{jθ}.
#[inline(always)] // in each period
fn rotor_flux(phi: Flux, frame: SinCos) -> AlphaBeta<Flux> {
    // φ̂ is at most twice the stated flux, which frees one bit.
    AlphaBeta {
        alpha: phi.top(frame.cos).scaled(),
        beta: phi.top(frame.sin).scaled(),
    }
}

/// Returns ε/2: z_q over the stated flux, clamped to ±1, and ±1 in full where the rotor points backwards.
#[inline(always)] // in each period
fn half_epsilon(config: &Config, z: Dq<Component>) -> I0F32 {
    let quarter = config.quarter_per_flux.of(z.q).to_bits();
    let clamped = if z.d.is_negative() {
        full_scale(quarter)
    } else {
        quarter.clamp(-ONE_QUARTER, ONE_QUARTER - 1)
    };
    I0F32::from_bits(clamped << 6)
}

/// Returns full scale with this sign.
#[cold]
#[inline(never)] // seldom
fn full_scale(quarter: i32) -> i32 {
    (quarter >> 31) ^ (ONE_QUARTER - 1)
}

/// A quarter with 27 fraction bits.
const ONE_QUARTER: i32 = 1 << 25;

/// Returns the rotor's angle at the next sample, if its flux is near the stated one.
pub fn locked_angle(state: &State) -> Option<Angle> {
    let locked = state.phi > FLUX_NOMINAL / 2 && state.phi < FLUX_NOMINAL * 2 - FLUX_NOMINAL / 2;
    locked.then_some(state.theta)
}

impl State {
    /// Returns the back-EMF.
    #[inline(always)] // in each period
    pub(super) fn emf(&self) -> WideVoltage {
        self.gains.emf.of(self.omega_i)
    }

    /// Returns ω̄̂.
    #[inline(always)] // in each period
    fn omega_bar(&self) -> Speed {
        self.omega_i.plus(self.excess)
    }
}

#[cfg(test)]
mod tests;
