//! The rotor's angle and speed from the voltages of the motor's terminals while the bridge is off
//! (second paper, 2.2.1: without current the terminal's voltage is the back-EMF).
//!
//! The readings are not the back-EMF itself. Dividers hold the terminals about ground, where a
//! converter reads nothing negative, so a small back-EMF shows its positive half-waves only. A
//! larger one turns on the low side's diode of the lowest phase, and all readings stand on that
//! phase's diode drop: `e_x − e_min − V_d`. A large one may be above the converter's range.
//!
//! The observer therefore predicts readings, through the same clamps, from an angle θ_e, a speed ω
//! and an amplitude E, and corrects by what differs:
//!
//! - A phase that stands at a clamp in prediction and reading says nothing.
//! - Of the others, the derivatives by θ_e and by E give the correction of each (Gauss-Newton).
//! - θ_e and ω are the line that fits all innovations so far best, by recursive least squares: of
//!   the weights w = Σ(∂r/∂θ_e)²/E² and their ages, S_0 = Σw, S_1 = Σw·age, S_2 = Σw·age² say
//!   how much of an innovation is the angle's and how much the speed's. So the gains fall as
//!   knowledge grows, rise again over a gap (in a sixth of a turn only one half-wave shows, near its
//!   top, and the angle is hardly seen), and the sums say how certain the speed is.
//! - The sums forget with a time constant of one electrical turn, so that a rotor that slows down is
//!   followed: a propeller coasts with a time constant of a second.
//!
//! It divides five times a period, in 64 bits; the bridge is off and nothing else is computed.

use fixed::types::extra::{U16, U32};
use fixed::types::{I4F28, I16F16};

use super::transform::{AlphaBeta, phases};
use crate::math::{Gain, SinCos, TopProduct, atan2_turns, magnitude, sin_cos};
use crate::units::{AdcCounts, Angle, Speed};

/// Noise of one reading that is reckoned with, counts rms.
const NOISE_COUNTS: i64 = 2;

/// The highest reading of the converter's 12 bits: it may be a clamp.
const CLAMP: i32 = 4094 << FRACTION;

/// Fraction bits of counts while they are worked on.
const FRACTION: u32 = 15;

/// Fraction bits of the sums.
const SUM_FRACTION: u32 = 12;

/// Highest reading from which an observation may begin, three times the noise.
const BEGIN: i32 = 6 << FRACTION;

/// Fastest forgetting, a quarter a period with 16 fraction bits: faster rotors are not driven.
const FORGET_MAX: i64 = 1 << 14;

/// Share of the newest sample in the squared residual's mean, as a shift.
const RESIDUAL_SHIFT: u32 = 4;

/// What the observer must know.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Speed to the back-EMF's amplitude that the stated flux gives, in counts of the terminals.
    pub emf: Gain<U32, U16>,
    /// A diode's drop.
    pub diode: AdcCounts,
    /// Noise times the amplitude a radian per period, counts²: (E/|ω|)·σ, which makes the first
    /// guess of the speed's uncertainty.
    pub prior: u32,
    /// Slowest forgetting, a share a period with 16 fraction bits.
    pub forget_min: u32,
    /// Mean of the highest reading below which the rotor stands, or turns so slowly that it can be
    /// aligned.
    pub standing: AdcCounts,
    /// Share of a new sample in that mean, 16 fraction bits.
    pub level_share: u32,
    /// Periods in a row for which all must fit before the rotor is known.
    pub sure_periods: u32,
    /// Periods for which something may not fit before the observation begins anew.
    pub lost_periods: u32,
}

/// What is known of the rotor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rotor {
    /// Not enough, yet.
    Unknown,
    /// It stands, or turns too slowly to be seen.
    Standing,
    /// It turns: the electrical angle of its flux at this sample and its speed, negative where it
    /// turns backwards.
    Turning {
        /// Angle of the flux.
        theta: Angle,
        /// Signed speed.
        omega: Speed,
    },
}

/// What is remembered from sample to sample.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Mean of the highest reading.
    pub level: AdcCounts,
    /// Samples of this observation; 0 while there is none.
    pub samples: u32,
    /// θ_e, the angle of the back-EMF's vector.
    pub theta: Angle,
    /// ω.
    pub omega: Speed,
    /// E, in counts.
    pub amplitude: AdcCounts,
    /// S_0, S_1, S_2, 12 fraction bits.
    pub sums: [i64; 3],
    /// Sum of the weights of E, likewise.
    pub amplitude_sum: i64,
    /// Mean of the squared residuals, counts² with 16 fraction bits.
    pub residual: i64,
    /// Periods in a row for which all fitted.
    pub fitting: u32,
    /// Periods for which something did not.
    pub unfitting: u32,
}

impl State {
    /// Nothing known.
    pub fn new(config: &Config) -> Self {
        Self {
            // Twice the threshold: a resting rotor is told from one that has not been seen.
            level: config.standing.saturating_mul_int(2),
            samples: 0,
            theta: Angle::ZERO,
            omega: Speed::ZERO,
            amplitude: AdcCounts::ZERO,
            sums: [0; 3],
            amplitude_sum: 0,
            residual: 0,
            fitting: 0,
            unfitting: 0,
        }
    }

    /// Hands out every word.
    pub fn trace(&self, out: &mut impl FnMut(u32)) {
        let Self {
            level,
            samples,
            theta,
            omega,
            amplitude,
            sums: [s_0, s_1, s_2],
            amplitude_sum,
            residual,
            fitting,
            unfitting,
        } = self;
        out(level.to_bits() as u32);
        out(*samples);
        out(theta.to_bits() as u32);
        out(omega.to_bits() as u32);
        out(amplitude.to_bits() as u32);
        for wide in [s_0, s_1, s_2, amplitude_sum, residual] {
            out(*wide as u32);
            out((wide >> 32) as u32);
        }
        out(*fitting);
        out(*unfitting);
    }

    /// Begins anew, but for the mean that tells a resting rotor.
    fn forget(&mut self, config: &Config) {
        *self = Self {
            level: self.level,
            ..Self::new(config)
        };
    }
}

/// Takes one sample of the terminals a, b, c with the bridge off and says what is known by now.
pub fn observe(config: &Config, state: &mut State, terminals: [AdcCounts; 3]) -> Rotor {
    let readings = terminals.map(|v| v.to_bits().clamp(0, 4095 << 16) >> (16 - FRACTION));
    let [a, b, c] = readings;
    let highest = i64::from(a.max(b).max(c)) << (16 - FRACTION);
    let level = i64::from(state.level.to_bits());
    let step = ((highest - level) * i64::from(config.level_share)) >> 16;
    state.level = I16F16::from_bits((level + step) as i32);
    if state.level < config.standing {
        state.forget(config);
        return Rotor::Standing;
    }
    match state.samples {
        0 => begin(config, state, readings),
        1 => second(config, state, readings),
        _ => follow(config, state, readings),
    }
    if state.samples == 0 || state.fitting < config.sure_periods {
        return Rotor::Unknown;
    }
    // The back-EMF leads the flux by a quarter of a turn, in the direction of rotation.
    let quarter = Angle::from_bits(if state.omega.is_negative() {
        -(1 << 30)
    } else {
        1 << 30
    });
    Rotor::Turning {
        theta: state.theta.wrapping_sub(quarter),
        omega: state.omega,
    }
}

/// Angle and amplitude of the vector that three readings make, or `None` where they do not: two of
/// them must be clearly above the clamp, the lower one at three tenths of the higher or more.
fn vector(config: &Config, readings: [i32; 3]) -> Option<(Angle, AdcCounts)> {
    let [a, b, c] = readings;
    let highest = a.max(b).max(c);
    let lowest = a.min(b).min(c);
    let sum = a + b + c;
    let middle = sum - highest - lowest;
    if highest < BEGIN || i64::from(middle) * 10 < i64::from(highest) * 3 {
        return None;
    }
    // Without the diode the phases' sum is zero; with it the lowest stands at its drop, and the
    // others' sum is above that.
    let below = (highest + middle).min(config.diode.to_bits() >> (16 - FRACTION));
    // Of equal lowest readings one is enough.
    let (a, b, c) = if a == lowest {
        (-below, b, c)
    } else if b == lowest {
        (a, -below, c)
    } else {
        (a, b, -below)
    };
    let alpha = (2 * a - b - c) / 3;
    // (b − c)/√3 with 1/√3 of 31 fraction bits.
    let beta = ((i64::from(b - c) * 1_239_850_263) >> 31) as i32;
    // The scale does not matter to an angle, and the length's is that of the components.
    let (alpha, beta) = (I4F28::from_bits(alpha), I4F28::from_bits(beta));
    let amplitude = I16F16::from_bits(magnitude(alpha, beta).to_bits() << (16 - FRACTION));
    Some((atan2_turns(beta, alpha), amplitude))
}

/// The first sample: the angle, and a speed about zero as uncertain as this amplitude lets it be.
fn begin(config: &Config, state: &mut State, readings: [i32; 3]) {
    let Some((theta, amplitude)) = vector(config, readings) else {
        state.samples = 0;
        return;
    };
    state.samples = 1;
    state.theta = theta;
    state.omega = Speed::ZERO;
    state.amplitude = amplitude;
    // (σ/E)² over the speed's variance, which with |ω| of E is (σ·(E/|ω|)/E²)².
    let square = i64::from(amplitude.to_bits() >> 8).pow(2);
    let ratio = (i64::from(config.prior) << (16 + SUM_FRACTION)) / square;
    let prior = ratio.min(1 << 26).pow(2) >> SUM_FRACTION;
    state.sums = [0, 0, prior];
    state.amplitude_sum = 0;
}

/// The second sample. Of a large back-EMF the difference of two vectors is the speed: the prediction
/// of a rotor at rest may be too far off. A small one is of a slow rotor, and too noisy for that.
fn second(config: &Config, state: &mut State, readings: [i32; 3]) {
    if state.amplitude <= config.diode.saturating_mul_int(2) {
        follow(config, state, readings);
        return;
    }
    let Some((theta, amplitude)) = vector(config, readings) else {
        state.samples = 0;
        return;
    };
    state.samples = 2;
    state.omega = theta.wrapping_sub(state.theta);
    state.theta = theta;
    state.amplitude = amplitude;
    // Two samples of weight 1.5 each, a period apart.
    let weight = 3 << (SUM_FRACTION - 1);
    state.sums = [2 * weight, weight, weight];
    state.amplitude_sum = 2 * weight;
}

/// Every later sample.
fn follow(config: &Config, state: &mut State, readings: [i32; 3]) {
    state.samples = state.samples.saturating_add(1);
    state.theta = state.theta.wrapping_add(state.omega);
    age(config, state);
    let Difference {
        by_angle,
        angle_weight,
        by_amplitude,
        amplitude_weight,
        squares,
    } = compare(config, state, readings);
    state.residual += (squares - state.residual) >> RESIDUAL_SHIFT;
    state.sums[0] += angle_weight;
    state.amplitude_sum += amplitude_weight;

    let [s_0, s_1, s_2] = state.sums;
    // Below a sixteenth of one good sample's weight nothing is known of the angle.
    if s_0 >= 1 << (SUM_FRACTION - 4) {
        let mean_age = (s_1 << SUM_FRACTION) / s_0;
        let spread = (s_2 - ((mean_age * s_1) >> SUM_FRACTION)).max(0);
        // 32 and 24 fraction bits.
        let k_omega = (mean_age << 32).checked_div(spread).unwrap_or(0);
        let k_omega = k_omega.min(1 << 33);
        let k_theta = (1 << (24 + SUM_FRACTION)) / s_0 + ((mean_age * k_omega) >> 20);
        let radians = (by_angle << 27) / i64::from(state.amplitude.to_bits());
        // 1/2π with 32 fraction bits; the bound is beyond any angle that a vector has.
        let turns = (radians.clamp(-(1 << 26), 1 << 26) * 683_565_276) >> 32;
        let step = |gain: i64, shift: u32| ((gain.min(1 << 33) * turns) >> shift) as i32;
        state.theta = state
            .theta
            .wrapping_add(Angle::from_bits(step(k_theta, 16)));
        state.omega = state
            .omega
            .saturating_add(Speed::from_bits(step(k_omega, 24)));
        judge(config, state, spread);
    }
    if state.amplitude_sum > 0 {
        let step = (by_amplitude << 15) / state.amplitude_sum;
        let amplitude = i64::from(state.amplitude.to_bits()) + step;
        // 1 to 8191 counts.
        state.amplitude = I16F16::from_bits(amplitude.clamp(1 << 16, 8191 << 16) as i32);
    }
    if state.unfitting > config.lost_periods {
        state.forget(config);
    }
}

/// Makes what the sums hold a period older, and forgets a share of it.
fn age(config: &Config, state: &mut State) {
    let [s_0, s_1, s_2] = state.sums;
    let a_turn = i64::from(state.omega.to_bits().unsigned_abs() >> 16);
    let share = a_turn.max(i64::from(config.forget_min)).min(FORGET_MAX);
    let keep = |sum: i64| sum - ((sum * share) >> 16);
    state.sums = [keep(s_0), keep(s_1 + s_0), keep(s_2 + 2 * s_1 + s_0)];
    state.amplitude_sum = keep(state.amplitude_sum);
}

/// What the readings say against the prediction: counts with 13 fraction bits, weights with
/// [`SUM_FRACTION`], squares with 16.
struct Difference {
    by_angle: i64,
    angle_weight: i64,
    by_amplitude: i64,
    amplitude_weight: i64,
    squares: i64,
}

fn compare(config: &Config, state: &State, readings: [i32; 3]) -> Difference {
    let SinCos { cos, sin } = sin_cos(state.theta);
    // What each phase sees of the vector, and how that changes with the angle.
    let seen = phases(AlphaBeta {
        alpha: cos,
        beta: sin,
    });
    let turned = phases(AlphaBeta {
        alpha: -sin,
        beta: cos,
    });
    let emf = seen.map(|share| state.amplitude.top(share).to_bits());
    let lowest = emf[0].min(emf[1]).min(emf[2]);
    let lift = -lowest - (config.diode.to_bits() >> (16 - FRACTION));
    // The phase at whose diode drop the readings stand, if it conducts.
    let base = if lift <= 0 {
        None
    } else {
        emf.iter().position(|&e| e == lowest)
    };
    let (base_seen, base_turned) = base.map_or((0, 0), |phase| {
        (seen[phase].to_bits() >> 1, turned[phase].to_bits() >> 1)
    });
    let half = state.amplitude.to_bits() >> (17 - FRACTION);
    let mut sum = Difference {
        by_angle: 0,
        angle_weight: 0,
        by_amplitude: 0,
        amplitude_weight: 0,
        squares: 0,
    };
    for phase in 0..3 {
        let predicted = emf[phase] + lift.max(0);
        let reading = readings[phase];
        if predicted >= CLAMP && reading >= CLAMP {
            continue;
        }
        let error = i64::from(reading - predicted.clamp(0, CLAMP));
        sum.squares += (error * error) >> (2 * FRACTION - 16);
        // A little above zero where nothing is predicted is noise; half the amplitude is not.
        if predicted <= 0 && reading < half {
            continue;
        }
        // 30 fraction bits, at most √3.
        let by_angle = i64::from((turned[phase].to_bits() >> 1) - base_turned);
        let by_amplitude = i64::from((seen[phase].to_bits() >> 1) - base_seen);
        sum.by_angle += (by_angle * error) >> 32;
        sum.by_amplitude += (by_amplitude * error) >> 32;
        sum.angle_weight += (by_angle * by_angle) >> (60 - SUM_FRACTION);
        sum.amplitude_weight += (by_amplitude * by_amplitude) >> (60 - SUM_FRACTION);
    }
    sum
}

/// Whether the speed is known to 1 % by what has been seen, over nearly half a turn, and amplitude,
/// speed and residual fit each other. `spread` is the sum of the squared ages about their mean.
fn judge(config: &Config, state: &mut State, spread: i64) {
    let amplitude = i64::from(state.amplitude.to_bits());
    let omega = i64::from(state.omega.to_bits()).abs();
    // The speed's standard deviation is σ/(E·√spread): (E·ω)² > (100·σ/2π)²/spread, 32 fraction bits.
    let slope = (amplitude * omega) >> 32;
    let wanted = (100 * NOISE_COUNTS).pow(2) * 10 / 395;
    let spread = spread.max(1);
    let precise = slope * slope > (wanted << (32 + SUM_FRACTION)) / spread;
    // The ages' standard deviation times ω is that of an arc of 0.43 turns: (0.123 turns)² of 40
    // fraction bits.
    let omega = omega >> 12;
    let far = omega * omega > (16_700_000_000 * state.sums[0]) / spread;
    let known = precise && far;
    // A flux between half and twice the stated one.
    let expected = i64::from(config.emf.saturating_apply(state.omega).to_bits()).abs();
    let fits = 2 * amplitude > expected && amplitude < 2 * expected;
    // Three readings' noise, twice, and an eighth of the amplitude for what the model leaves out:
    // the diode's drop depends on its current.
    let noise = (6 * NOISE_COUNTS * NOISE_COUNTS) << 16;
    let quiet = state.residual < noise + ((amplitude >> 3).pow(2) >> 16);
    if known && fits && quiet {
        state.fitting = state.fitting.saturating_add(1);
        state.unfitting = 0;
    } else {
        state.fitting = 0;
        let settled = state.samples > config.lost_periods;
        if settled && (!quiet || (known && !fits)) {
            state.unfitting += 1;
        }
    }
}

#[cfg(test)]
mod tests;
