//! The rotor's flux linkage with each phase (second paper, section 2.2, figure 17): λ = ∫(v −
//! i·R)dt − i·L_s, by a leaky pseudo-integrator, with limits against residual bias.

use fixed::FixedI32;
use fixed::types::extra::U32;
use siskin_units::math::{Gain, Held, SinCos, TopProduct, atan2_turns};
use siskin_units::{Angle, Current, FLUX_NOMINAL, Flux, Speed, Voltage, traced};

use super::sector::Sector;

/// Smallest credible amplitude: 0.3 times the stated flux.
pub const AMPLITUDE_MIN: Flux = Flux::from_bits(51_267_396);
/// Largest credible amplitude: twice the stated flux.
pub const AMPLITUDE_MAX: Flux = Flux::from_bits(341_782_638);

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// R, from current to voltage.
    pub resistance: Gain<Current, Voltage>,
    /// L_s, from current to flux.
    pub inductance: Gain<Current, Flux>,
    /// 1 − e^(−T_s/τ_int), the integrator's leak per period.
    pub forget: Gain<Flux, Flux>,
    /// 1/τ_int as a speed, the integrator's corner.
    pub corner: Speed,
    /// The additional high-pass of the second-order form.
    pub high_pass: Option<HighPass>,
    /// i_max·L_s, by which the integrator's limit exceeds that of the rotor's flux.
    pub stator_max: Flux,
    /// The limits follow the measured amplitude; otherwise the stated flux sets them.
    pub adaptive: bool,
}

/// A first-order high-pass.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HighPass {
    /// 1 − e^(−T_s/τ_HPFS).
    pub share: Gain<Flux, Flux>,
    /// 1/τ_HPFS as a speed.
    pub corner: Speed,
}

traced! {
    /// State of the three phases' flux observers.
    #[derive(Clone, Debug, PartialEq)]
    pub struct State {
        /// Integral of v − i·R.
        pub psi: [Flux; 3],
        /// Its slow mean, which the high-pass removes.
        pub mean: [Flux; 3],
        /// λ̂ of the phases at this sample.
        pub lambda: [Flux; 3],
        /// λ̂ at the previous sample.
        pub lambda_before: [Flux; 3],
        /// Currents at the last sample.
        pub i_before: [Current; 3],
        /// Amplitude of λ̂, which sets limits and deadband.
        pub amplitude: Flux,
    }
}

impl Default for State {
    fn default() -> Self {
        Self {
            psi: [Flux::ZERO; 3],
            mean: [Flux::ZERO; 3],
            lambda: [Flux::ZERO; 3],
            lambda_before: [Flux::ZERO; 3],
            i_before: [Current::ZERO; 3],
            amplitude: FLUX_NOMINAL,
        }
    }
}

/// Runs one period: `v` are the mean phase voltages since the last sample, `i` the currents at this
/// one.
pub fn advance(config: &Config, state: &mut State, v: [Voltage; 3], i: [Current; 3]) {
    let lambda_max: Flux = state.amplitude + (state.amplitude >> 2);
    let psi_max = lambda_max.plus(config.stator_max);
    state.lambda_before = state.lambda;
    for phase in 0..3 {
        // The resistive drop over a period is that of the mean current.
        let mean_i = (i[phase] >> 1) + (state.i_before[phase] >> 1);
        let drive = v[phase].minus(config.resistance.held(mean_i));
        let psi = state.psi[phase];
        let psi = (psi - config.forget.apply(psi)).plus(drive.over_period());
        let psi = psi.min(psi_max).max(-psi_max);
        state.psi[phase] = psi;
        let integral = match &config.high_pass {
            None => psi,
            Some(high_pass) => {
                let off = psi.minus(state.mean[phase]);
                let mean = state.mean[phase].plus(high_pass.share.apply(off));
                state.mean[phase] = mean;
                psi.minus(mean)
            }
        };
        let lambda = integral.minus(config.inductance.held(i[phase]));
        state.lambda[phase] = lambda.min(lambda_max).max(-lambda_max);
    }
    state.i_before = i;
}

/// Returns the flux amplitude at the crossing that begins a sector, where the two other phases are
/// at ±√3/2 of it. A common bias cancels.
pub fn measure(lambda: &[Flux; 3], sector: Sector) -> Flux {
    let phase = sector.edge().phase;
    let (one, other) = (lambda[(phase + 1) % 3], lambda[(phase + 2) % 3]);
    // Each is at most 1.25 · 2 · 2/π, so the difference stays below 3.2 of 8.
    let difference = one.minus(other).saturating_abs();
    let half = difference.top(ROOT_3_SIXTH);
    half.plus(half)
}

/// √3/6 with 32 fraction bits.
const ROOT_3_SIXTH: FixedI32<U32> = FixedI32::from_bits(1_239_850_262);

/// Updates the limits by an eighth of the difference to a measured amplitude. A bias, which adds at
/// one crossing and subtracts at the opposite one, averages out.
pub fn adapt(config: &Config, state: &mut State, measured: Flux) {
    if config.adaptive {
        let step = measured.minus(state.amplitude) >> 3;
        let amplitude = state.amplitude.plus(step);
        state.amplitude = amplitude.min(AMPLITUDE_MAX).max(AMPLITUDE_MIN);
    }
}

/// Returns by how much λ̂ leads the rotor's flux at this speed: 90° − arctan(τ_int·ω), plus the
/// same for the high-pass (2.2.2). Zero without a speed.
pub fn lead(config: &Config, omega: Speed) -> Angle {
    let second = config.high_pass.as_ref().map(|high_pass| high_pass.corner);
    let second = second.map_or(Angle::ZERO, |corner| lead_of(corner, omega));
    lead_of(config.corner, omega) + second
}

/// Returns arctan(corner/ω), 0 to a quarter turn.
fn lead_of(corner: Speed, omega: Speed) -> Angle {
    if omega <= Speed::ZERO {
        return Angle::ZERO;
    }
    atan2_turns(corner, omega)
}

/// Begins as if the rotor had long turned at `omega` and its flux were now at `theta`.
pub fn begin(config: &Config, state: &mut State, theta: Angle, omega: Speed, i: [Current; 3]) {
    // A first-order filter that leads by δ has the gain cos δ.
    let first = lead_of(config.corner, omega);
    let both = lead(config, omega);
    let length = shortened(FLUX_NOMINAL, first);
    let integral = phases(length, theta.wrapping_add(first));
    let length = shortened(length, both.wrapping_sub(first));
    let lambda = phases(length, theta.wrapping_add(both));
    let stator = i.map(|i| config.inductance.held(i));
    *state = State {
        psi: [0, 1, 2].map(|phase| integral[phase].plus(stator[phase])),
        mean: [0, 1, 2].map(|phase| integral[phase] - lambda[phase]),
        lambda,
        lambda_before: lambda,
        i_before: i,
        amplitude: FLUX_NOMINAL,
    };
}

/// Returns the three phase components of a flux of this length and direction.
fn phases(length: Flux, theta: Angle) -> [Flux; 3] {
    let third = Angle::from_bits(THIRD_TURN);
    let around = [Angle::ZERO, third.wrapping_neg(), third];
    around.map(|shift| shortened(length, theta.wrapping_add(shift)))
}

/// 2^32/3.
const THIRD_TURN: i32 = 1_431_655_765;

/// Returns the flux times the angle's cosine.
fn shortened(flux: Flux, angle: Angle) -> Flux {
    // 28 + 31 − 32 fraction bits.
    flux.top(SinCos::of(angle).cos).scaled()
}

#[cfg(test)]
mod tests;
