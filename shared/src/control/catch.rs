//! Flying start: the rotor's angle and speed from the terminal voltages while the bridge is off (second paper,
//! 2.2.1: without current the terminal voltage is the back-EMF).
//!
//! The readings are not the back-EMF itself. Dividers hold the terminals around ground, where the ADC reads nothing
//! negative, so a small back-EMF shows only its positive half-waves. A larger one turns on the low-side diode of
//! the lowest phase, and all readings sit on that diode's drop: `e_x − e_min − V_d`. A large one may exceed the
//! ADC's range.
//!
//! The observer therefore predicts readings, through the same clamps, from an angle θ_e, a speed ω and an
//! amplitude E, and corrects by the differences:
//!
//! - A phase at a clamp in both prediction and reading carries no information.
//! - For the others, the derivatives by θ_e and by E give each correction (Gauss-Newton): `compare.rs`.
//! - θ_e and ω are the line that best fits all innovations so far, by recursive least squares. Of the weights
//!   w = Σ(∂r/∂θ_e)²/E² and their ages, S_0 = Σw, S_1 = Σw·age and S_2 = Σw·age² split an innovation between angle
//!   and speed. So the gains fall as knowledge grows, and rise again over a gap (for a sixth of a turn only one
//!   half-wave shows, near its peak, where the angle is hardly visible), and the sums tell the speed's uncertainty:
//!   `least_squares.rs`.
//! - The sums forget with a time constant of one electrical turn, so that the observer follows a decelerating
//!   rotor: a propeller coasts with a time constant of a second.
//!
//! A bridge-off period must take no longer than a driving one, so the work is spread over four periods, one stage
//! each (`Stage`). For a slow rotor, whose readings are small against the noise, the mean of four readings is
//! compared. Ages, and all times in the configuration, count such looks.

mod compare;
mod least_squares;
mod state;

use fixed::types::{I0F32, I4F28, I16F16, I17F15, I20F12};
pub use state::{Config, LOOK_PERIODS, State};
use state::{LOOK_SHIFT, SUM_FRACTION, Stage};

use compare::Difference;
use siskin_units::math::{SinCos, TopProduct, atan2_turns};
use siskin_units::trace::Trace;
use siskin_units::{AdcCounts, Angle, QUARTER_TURN, Speed};

/// The highest reading that an observation needs to begin: three times the noise.
const BEGIN: I17F15 = I17F15::lit("6");

/// The result of observing the rotor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rotor {
    /// Not enough known yet.
    Unknown,
    /// At rest, or too slow to see.
    Standing,
    /// Turning: electrical angle of the flux at this sample and speed, negative when backwards.
    Turning {
        /// Angle of the flux.
        theta: Angle,
        /// Signed speed.
        omega: Speed,
    },
}

impl Trace for Rotor {
    /// A constant number of words whatever is known, so that a word's position identifies it.
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

/// Processes one sample of terminals a, b, c with the bridge off; returns what is known so far.
#[inline(never)] // only some periods
pub fn observe(config: &Config, state: &mut State, terminals: [AdcCounts; 3]) -> Rotor {
    state.theta = state.theta.wrapping_add(state.omega.over_period());
    // 12 bits plus fraction, whatever lies above.
    let reading = |v: AdcCounts| I17F15::from_bits(v.to_bits() >> 1 & ((1 << 27) - 1));
    let [a, b, c] = terminals;
    let readings @ [a, b, c] = [reading(a), reading(b), reading(c)];
    if state.stage == Stage::Compare {
        compare_readings(config, state, readings);
    } else {
        let [before_a, before_b, before_c] = state.readings;
        state.readings = [before_a + a, before_b + b, before_c + c];
        least_squares::run_stage(config, state);
    }
    if state.level < config.standing {
        Rotor::Standing
    } else if state.looks == 0 || state.fits < config.sure_looks {
        Rotor::Unknown
    } else {
        // The back-EMF leads the flux by a quarter of a turn, in the direction of rotation.
        let quarter = if state.omega.is_negative() {
            -QUARTER_TURN
        } else {
            QUARTER_TURN
        };
        Rotor::Turning {
            theta: state.theta.wrapping_sub(quarter),
            omega: state.omega,
        }
    }
}

/// Runs the first stage: acquires the rotor, or tracks it.
fn compare_readings(config: &Config, state: &mut State, readings: [I17F15; 3]) {
    let [a, b, c] = readings;
    let highest = I16F16::from_bits(a.max(b).max(c).to_bits() << 1);
    state.level += (highest - state.level).top(config.level_share);
    if state.level < config.standing || state.misfits > config.lost_looks {
        state.restart();
    } else if state.is_acquiring(config) {
        acquire(config, state, readings);
    } else {
        track(config, state, readings);
    }
}

/// Acquires the rotor by one look: two looks, a period apart, where the back-EMF is large.
#[cold]
#[inline(never)] // only some periods
fn acquire(config: &Config, state: &mut State, readings: [I17F15; 3]) {
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
        // Two looks of weight 1.5 each, a quarter of the usual interval apart.
        state.weight = const { I20F12::lit("3") };
        state.ages = [3 << (SUM_FRACTION - 3), 3 << (SUM_FRACTION - 5)];
        state.amplitude_weight = state.weight;
    }
    if !state.is_acquiring(config) {
        // There is nothing to weigh; this reading is the first of the next mean.
        state.difference = Difference::default();
        state.readings = readings;
        state.stage = Stage::Correct;
    }
}

/// Returns angle and amplitude of the vector formed by three readings. `None` unless two are clearly above the
/// clamp, the lower of them at least three tenths of the higher.
fn vector(config: &Config, [a, b, c]: [I17F15; 3]) -> Option<(Angle, AdcCounts)> {
    let highest = a.max(b).max(c);
    let lowest = a.min(b).min(c);
    let middle = a + b + c - highest - lowest;
    // Actually 39/128.
    let three_tenths = (highest >> 2) + (highest >> 4) - (highest >> 7);
    if highest < BEGIN || middle < three_tenths {
        return None;
    }
    // Without the diode the phases sum to zero; with it the lowest sits at the diode's drop, and the other two sum
    // to more than that.
    let below = (highest + middle).min(I17F15::from_bits(config.diode.to_bits() >> 1));
    // If several readings tie for the lowest, one suffices.
    let (a, b, c) = if a == lowest {
        (-below, b, c)
    } else if b == lowest {
        (a, -below, c)
    } else {
        (a, b, -below)
    };
    // 3/2 of the components, half of that for beta: the angle needs only their ratio.
    let alpha: I17F15 = a - ((b + c) >> 1);
    let beta: I17F15 = (b - c).top(HALF_ROOT_3);
    let theta = atan2_turns(
        I4F28::from_bits(beta.to_bits() << 1),
        I4F28::from_bits(alpha.to_bits()),
    );
    let along = SinCos::of(theta);
    let length = alpha.top(along.cos) + (beta + beta).top(along.sin);
    let third = length.top(THIRD);
    // From 14 to 16 fraction bits, times two: two thirds.
    Some((theta, AdcCounts::from_bits(third.to_bits() << 3)))
}

/// Begins with a speed of zero, as uncertain as this amplitude allows.
fn begin(config: &Config, state: &mut State) {
    state.omega = Speed::ZERO;
    // (σ/E)² over the speed's variance, which for |ω| as of E is (σ·(E/|ω|)/E²)²: the root with 8 fraction bits. E
    // is at least 4 counts, of which 4 fraction bits are kept.
    let divisor = (state.amplitude.to_bits() >> 12) as u32;
    let root = (((config.prior << 12) / divisor) << 4) / divisor;
    let root = u64::from(root.min(1 << 22));
    state.weight = I20F12::ZERO;
    state.ages = [0, ((root * root) >> 4) as i64];
    state.amplitude_weight = I20F12::ZERO;
}

/// Tracks the rotor: compares every later look.
fn track(config: &Config, state: &mut State, readings: [I17F15; 3]) {
    let (theta, readings) = if state.is_slow() {
        let [before_a, before_b, before_c] = state.readings;
        let [a, b, c] = readings;
        let mean = [
            (before_a + a) >> LOOK_SHIFT,
            (before_b + b) >> LOOK_SHIFT,
            (before_c + c) >> LOOK_SHIFT,
        ];
        // Midway between the second and the third reading.
        let back = state.omega.wrapping_add(state.omega >> 1);
        (state.theta.wrapping_sub(back.over_period()), mean)
    } else {
        (state.theta, readings)
    };
    state.difference = compare::compare(config.diode, theta, state.amplitude, readings);
    state.looks = state.looks.saturating_add(1);
    state.readings = [I17F15::ZERO; 3];
    state.stage = Stage::Gains;
}

/// √3/4; adding the product to itself gives √3/2.
const HALF_ROOT_3: I0F32 = I0F32::lit("0.4330127018922");

/// A third.
const THIRD: I0F32 = I0F32::lit("0.3333333333");

#[cfg(test)]
mod tests;
