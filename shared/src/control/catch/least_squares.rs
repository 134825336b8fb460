//! The rotor estimate from the looks so far, by recursive least squares, and the quality of its fit.

use fixed::types::{I0F32, I16F16, I17F15, I20F12};
use siskin_units::math::{Held, TopProduct};
use siskin_units::{Angle, Speed};

use super::{Config, LOOK_SHIFT, SUM_FRACTION, Stage, State};

/// Speed of the fastest forgetting, a sixteenth of a turn per period with 32 fraction bits.
const FORGET_MAX: i32 = 1 << 28;

/// Smallest S_0 at which the angle is corrected, a sixteenth of one good look's weight; below it the angle is
/// unknown.
const WEIGHT_MIN: I20F12 = I20F12::lit("0.0625");

/// Smallest sum of E's weights at which E is corrected.
const AMPLITUDE_WEIGHT_MIN: I20F12 = I20F12::lit("0.25");

/// Bounds of E, counts.
const AMPLITUDE: [I16F16; 2] = [I16F16::lit("1"), I16F16::lit("8191")];

/// 0.43 turns with 32 fraction bits.
const FAR: u64 = 1_846_835_937;

/// 1/2π with 32 fraction bits.
const TURNS_PER_RADIAN: i32 = 683_565_276;

/// (σ/(2π·0.01))², counts², for a speed known to 1 % with a reading noise σ of 2 counts.
const WANTED: u64 = 1012;

/// Weight of the newest look in the residual's mean, as a right shift.
const RESIDUAL_SHIFT: u32 = 3;

/// Largest residual that noise alone leaves: three magnitudes average 0.8·σ each, 4.8 counts in all, and their mean
/// over eight looks scatters by 0.5.
const QUIET: I17F15 = I17F15::lit("7");

/// Runs the stage of a period after a look.
#[inline(never)] // only some periods
pub(super) fn run_stage(config: &Config, state: &mut State) {
    match state.stage {
        Stage::Compare => {}
        Stage::Gains => {
            state.stage = Stage::Correct;
            update_gains(config, state);
        }
        Stage::Correct => {
            state.stage = Stage::CheckFit;
            correct(state);
        }
        Stage::CheckFit => {
            state.stage = Stage::Compare;
            check_fit(config, state);
        }
    }
}

/// Ages the sums by one look, forgets a share of them and adds the last look's weights; derives the gains and the
/// spread of the ages.
fn update_gains(config: &Config, state: &mut State) {
    let omega = state.omega.to_bits().saturating_abs().min(FORGET_MAX);
    // A turn is 1/(4·ω) looks.
    let share = (omega << LOOK_SHIFT).max(config.forget_min.to_bits());
    let share = I0F32::from_bits(share);
    // Sixteen fraction bits of the share: S_2 has up to 47 bits.
    let age_share = (share.to_bits() >> 16) as u32;
    let kept = |sum: i64| sum - ((sum as u64 * u64::from(age_share)) >> 16) as i64;
    let [s_1, s_2] = state.ages;
    let s_0 = i64::from(state.weight.to_bits());
    let [s_1, s_2] = [kept(s_1 + s_0), kept(s_2 + 2 * s_1 + s_0)];
    state.ages = [s_1, s_2];
    let difference = &state.difference;
    let angle_weight = I20F12::from_bits(difference.angle_weight.to_bits() >> 16);
    let amplitude_weight = I20F12::from_bits(difference.amplitude_weight.to_bits() >> 16);
    state.weight += angle_weight - state.weight.top(share);
    state.amplitude_weight += amplitude_weight - state.amplitude_weight.top(share);
    if state.weight < WEIGHT_MIN {
        return;
    }
    let weight = state.weight.to_bits() as u32;
    // 12 fraction bits: S_1 fits with 6 of its own.
    let mean_age = quotient((s_1 >> 6) as i32, weight, 18);
    let moment = (s_1 as u64 * mean_age as u64) >> SUM_FRACTION;
    let spread = (s_2 - moment as i64).max(0) as u64;
    // At most 1 with 30 fraction bits. A large spread needs no fraction.
    (state.spread, state.speed_gain) = if spread >> 32 != 0 {
        let whole = (spread >> 16) as u32;
        (whole.min(u32::MAX >> 4) << 4, quotient(mean_age, whole, 14))
    } else {
        let divisor = (spread as u32).max(mean_age as u32).max(1);
        (
            (spread >> SUM_FRACTION) as u32,
            quotient(mean_age, divisor, 30),
        )
    };
    state.mean_age = mean_age;
}

/// Corrects angle, speed and amplitude by the last look's difference.
fn correct(state: &mut State) {
    let amplitude = state.amplitude.to_bits();
    if state.weight >= WEIGHT_MIN {
        // The innovation, from operands with 13 and 16 fraction bits: 24 bits, at most 4 radians; in turns 28.
        let most = amplitude >> 1;
        let by_angle = state.difference.by_angle.to_bits().max(-most).min(most);
        let radians = quotient(by_angle, amplitude as u32, 27);
        let turns = ((i64::from(radians << 4) * i64::from(TURNS_PER_RADIAN)) >> 32) as i32;
        // 30 + 28 fraction bits to 32 per look; per period a quarter of that.
        let faster = (i64::from(state.speed_gain) * i64::from(turns)) >> 26;
        let omega = Speed::from_bits((faster >> LOOK_SHIFT) as i32);
        // k_θ = 1/S_0 + mean age·k_ω. The speed correction counts from the look, two periods ago, or from the
        // middle of four readings.
        let older = (faster * i64::from(state.mean_age)) >> SUM_FRACTION;
        let ahead = quotient(turns, state.weight.to_bits() as u32, 16).wrapping_add(older as i32);
        let since = if state.is_slow() { 7 } else { 4 };
        let ahead = ahead.wrapping_add((omega.to_bits() >> 1).wrapping_mul(since));
        state.omega = state.omega.plus(omega);
        state.theta = state.theta.wrapping_add(Angle::from_bits(ahead));
    }
    if state.amplitude_weight >= AMPLITUDE_WEIGHT_MIN {
        // 13 − 12 fraction bits; 16 wanted.
        let weight = state.amplitude_weight.to_bits() as u32;
        let step = quotient(state.difference.by_amplitude.to_bits(), weight, 15);
        let amplitude = state.amplitude.plus(I16F16::from_bits(step));
        state.amplitude = amplitude.max(AMPLITUDE[0]).min(AMPLITUDE[1]);
    }
}

/// Judges whether the speed is known, and whether amplitude, speed and residual agree.
fn check_fit(config: &Config, state: &mut State) {
    state.residual += (state.difference.misfit - state.residual) >> RESIDUAL_SHIFT;
    let omega = state.omega.magnitude_bits();
    let turns_per_look = omega.min(u32::MAX >> LOOK_SHIFT) << LOOK_SHIFT;
    // 0.43 turns since the observation began.
    let far = u64::from(turns_per_look) * u64::from(state.looks) > FAR;
    let known = is_speed_precise(state, turns_per_look) && far;
    let fits = fits_stated_flux(config, state, omega);
    let quiet = is_quiet(state);
    if known && fits && quiet {
        state.fits = state.fits.saturating_add(1);
        state.misfits = 0;
    } else {
        state.fits = 0;
        let settled = state.looks > config.lost_looks;
        if settled && (!quiet || (known && !fits)) {
            state.misfits += 1;
        }
    }
}

/// Returns true if the readings pin the speed to 1 %.
///
/// Its standard deviation is σ/(E·√spread) radians per look: (E·ω)² > WANTED/spread with ω in turns per look, four
/// times that per period.
fn is_speed_precise(state: &State, turns_per_look: u32) -> bool {
    let amplitude = state.amplitude.to_bits() as u32;
    // 16 fraction bits, and at most 64 counts, at which a spread of one suffices.
    let slope = ((u64::from(amplitude) * u64::from(turns_per_look)) >> 32).min(1 << 22);
    // The mean of four readings has half the noise.
    let averaged_shift = if state.is_slow() { 2 } else { 0 };
    // Over a gap between half-waves a known speed fades: half of that suffices.
    let known_shift = u32::from(state.fits > 0);
    // Drops eight fraction bits of the square.
    let wanted = (WANTED << (32 - 8)) >> averaged_shift >> known_shift;
    ((slope * slope) >> 8) * u64::from(state.spread.min(1 << 24)) > wanted
}

/// Returns true if amplitude and speed make a flux between half and twice the stated one.
fn fits_stated_flux(config: &Config, state: &State, omega: u32) -> bool {
    let expected = ((u64::from(config.emf) * u64::from(omega)) >> 32) as u32;
    let found = state.amplitude.to_bits() as u32 >> 8;
    2 * found > expected && found < 2 * expected
}

/// Returns true if the residual is what noise and unmodelled effects leave: three sixteenths of the amplitude for
/// the latter, since the diode drop depends on its current.
fn is_quiet(state: &State) -> bool {
    let amplitude = state.amplitude.to_bits() as u32;
    let unmodelled = I17F15::from_bits((amplitude >> 4) as i32 + (amplitude >> 5) as i32);
    state.residual < QUIET + unmodelled
}

/// Returns the lower 32 bits of `a·2^fraction/by`, within 2^-15 of its value. `by` must not be 0, and `fraction` at
/// most 33.
///
/// Uses one 32-by-16-bit division: the chip has no 64-bit one.
#[inline(never)] // only some periods
fn quotient(a: i32, by: u32, fraction: u32) -> i32 {
    let zeros = by.leading_zeros();
    // 2^32 over the divisor's upper 16 bits: 17 bits, and 1/by = reciprocal·2^(zeros − 48).
    let reciprocal = u32::MAX / ((by << zeros) >> 16);
    let product = (i64::from(a) * i64::from(reciprocal)) << 15;
    (product >> (63 - zeros - fraction)) as i32
}
