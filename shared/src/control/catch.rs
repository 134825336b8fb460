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
//! - Of the others, the derivatives by θ_e and by E give the correction of each (Gauss-Newton):
//!   `compare.rs`.
//! - θ_e and ω are the line that fits all innovations so far best, by recursive least squares: of
//!   the weights w = Σ(∂r/∂θ_e)²/E² and their ages, S_0 = Σw, S_1 = Σw·age, S_2 = Σw·age² say
//!   how much of an innovation is the angle's and how much the speed's. So the gains fall as
//!   knowledge grows, rise again over a gap (in a sixth of a turn only one half-wave shows, near its
//!   top, and the angle is hardly seen), and the sums say how certain the speed is: `learn.rs`.
//! - The sums forget with a time constant of one electrical turn, so that a rotor that slows down is
//!   followed: a propeller coasts with a time constant of a second.
//!
//! A period with the bridge off is to be no longer than one that drives, so the work is done in
//! four periods, a stage in each (`Stage`). A slow rotor, whose readings are small in their noise, is
//! compared with the mean of four readings. Ages are in such looks, and so are all times of the
//! configuration.

mod compare;
mod learn;
mod state;

use fixed::types::{I0F32, I4F28, I16F16, I17F15, I20F12};
pub use state::{Config, LOOK_PERIODS, State};
use state::{LOOK_SHIFT, SUM_FRACTION, Stage};

use crate::math::{SinCos, TopProduct, atan2_turns};
use crate::trace::Trace;
use crate::units::{AdcCounts, Angle, Speed};
use compare::Difference;

/// Highest reading from which an observation may begin, three times the noise.
const BEGIN: I17F15 = I17F15::lit("6");

/// The result of observing the rotor.
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

impl Trace for Rotor {
    /// As many words whatever is known, so that a word's place tells what it is.
    fn trace(&self, out: &mut impl FnMut(u32)) {
        let (kind, theta, omega) = match *self {
            Self::Unknown => (0, Angle::ZERO, Speed::ZERO),
            Self::Standing => (1, Angle::ZERO, Speed::ZERO),
            Self::Turning { theta, omega } => (2, theta, omega),
        };
        out(kind);
        theta.trace(out);
        omega.trace(out);
    }
}

/// Takes one sample of the terminals a, b, c with the bridge off and says what is known by now.
#[inline(never)] // only some periods
pub fn observe(config: &Config, state: &mut State, terminals: [AdcCounts; 3]) -> Rotor {
    state.theta = state.theta.wrapping_add(state.omega.over_period());
    // 12 bits and their fraction, whatever is above.
    let held = |v: AdcCounts| I17F15::from_bits(v.to_bits() >> 1 & ((1 << 27) - 1));
    let [a, b, c] = terminals;
    let readings @ [a, b, c] = [held(a), held(b), held(c)];
    if state.stage == Stage::Look {
        look(config, state, readings);
    } else {
        let [before_a, before_b, before_c] = state.readings;
        state.readings = [before_a + a, before_b + b, before_c + c];
        learn::learn(config, state);
    }
    if state.level < config.standing {
        Rotor::Standing
    } else if state.looks == 0 || state.fitting < config.sure_looks {
        Rotor::Unknown
    } else {
        // The back-EMF leads the flux by a quarter of a turn, in the direction of rotation.
        let quarter = if state.omega.is_negative() {
            -1 << 30
        } else {
            1 << 30
        };
        Rotor::Turning {
            theta: state.theta.wrapping_sub(Angle::from_bits(quarter)),
            omega: state.omega,
        }
    }
}

/// A look at the terminals.
fn look(config: &Config, state: &mut State, readings: [I17F15; 3]) {
    let [a, b, c] = readings;
    let highest = I16F16::from_bits(a.max(b).max(c).to_bits() << 1);
    state.level += (highest - state.level).top(config.level_share);
    if state.level < config.standing || state.unfitting > config.lost_looks {
        state.restart();
    } else if state.seeks(config) {
        seek(config, state, readings);
    } else {
        follow(config, state, readings);
    }
}

/// One look of a beginning: two of them, a period apart, where the back-EMF is large.
#[cold]
#[inline(never)] // only some periods
fn seek(config: &Config, state: &mut State, readings: [I17F15; 3]) {
    let Some((theta, amplitude)) = vector(config, readings) else {
        state.restart();
        return;
    };
    let before = state.theta;
    state.theta = theta;
    state.amplitude = amplitude;
    state.looks += 1;
    if state.looks == 1 {
        begin(config, state);
    } else {
        state.omega = theta.wrapping_sub(before).per_period();
        // Two looks of weight 1.5 each, a quarter of the usual time apart.
        state.weight = const { I20F12::lit("3") };
        state.ages = [3 << (SUM_FRACTION - 3), 3 << (SUM_FRACTION - 5)];
        state.amplitude_weight = state.weight;
    }
    if !state.seeks(config) {
        // There is nothing to weigh; this reading is the first of the next mean.
        state.difference = Difference::default();
        state.readings = readings;
        state.stage = Stage::Correct;
    }
}

/// Angle and amplitude of the vector that three readings make, or `None` where they do not: two of
/// them must be clearly above the clamp, the lower one at three tenths of the higher or more.
fn vector(config: &Config, [a, b, c]: [I17F15; 3]) -> Option<(Angle, AdcCounts)> {
    let highest = a.max(b).max(c);
    let lowest = a.min(b).min(c);
    let middle = a + b + c - highest - lowest;
    // 39/128 of it.
    let three_tenths = (highest >> 2) + (highest >> 4) - (highest >> 7);
    if highest < BEGIN || middle < three_tenths {
        return None;
    }
    // Without the diode the phases' sum is zero; with it the lowest stands at its drop, and the
    // others' sum is above that.
    let below = (highest + middle).min(I17F15::from_bits(config.diode.to_bits() >> 1));
    // Of equal lowest readings one is enough.
    let (a, b, c) = if a == lowest {
        (-below, b, c)
    } else if b == lowest {
        (a, -below, c)
    } else {
        (a, b, -below)
    };
    // 3/2 of the components, and of beta half of that: to the angle only their ratio matters.
    let alpha: I17F15 = a - ((b + c) >> 1);
    let beta: I17F15 = (b - c).top(HALF_ROOT_3);
    let theta = atan2_turns(
        I4F28::from_bits(beta.to_bits() << 1),
        I4F28::from_bits(alpha.to_bits()),
    );
    let along = SinCos::of(theta);
    let length = alpha.top(along.cos) + (beta + beta).top(along.sin);
    let third = length.top(THIRD);
    // Of 14 fraction bits; two thirds of 16.
    Some((theta, AdcCounts::from_bits(third.to_bits() << 3)))
}

/// A speed about zero, as uncertain as this amplitude lets it be.
fn begin(config: &Config, state: &mut State) {
    state.omega = Speed::ZERO;
    // (σ/E)² over the speed's variance, which with |ω| of E is (σ·(E/|ω|)/E²)²: the root with 8
    // fraction bits. E is at least 4 counts, of which 4 fraction bits are kept.
    let divisor = (state.amplitude.to_bits() >> 12) as u32;
    let root = (((config.prior << 12) / divisor) << 4) / divisor;
    let root = u64::from(root.min(1 << 22));
    state.weight = I20F12::ZERO;
    state.ages = [0, ((root * root) >> 4) as i64];
    state.amplitude_weight = I20F12::ZERO;
}

/// Every later look.
fn follow(config: &Config, state: &mut State, readings: [I17F15; 3]) {
    let (theta, readings) = if state.is_slow() {
        let [before_a, before_b, before_c] = state.readings;
        let [a, b, c] = readings;
        let mean = [
            (before_a + a) >> LOOK_SHIFT,
            (before_b + b) >> LOOK_SHIFT,
            (before_c + c) >> LOOK_SHIFT,
        ];
        // Between the second and the third of them.
        let back = state.omega.wrapping_add(state.omega >> 1);
        (state.theta.wrapping_sub(back.over_period()), mean)
    } else {
        (state.theta, readings)
    };
    state.difference = compare::compare(config.diode, theta, state.amplitude, readings);
    state.looks = state.looks.saturating_add(1);
    state.readings = [I17F15::ZERO; 3];
    state.stage = Stage::Weigh;
}

/// √3/4, which with a sum of its product makes √3/2.
const HALF_ROOT_3: I0F32 = I0F32::lit("0.4330127018922");

/// A third.
const THIRD: I0F32 = I0F32::lit("0.3333333333");

#[cfg(test)]
mod tests;
