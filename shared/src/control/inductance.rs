//! Inductance adaptation: a wrong L̂ rotates the estimated angle by asin(ΔL·i_q/φ), which constant
//! current does not reveal.
//!
//! So i_d* carries a square wave. An observer that takes ψ − L̂·i for the rotor's flux sees φ̂ = φ
//! + (L − L̂)·i_d along d, so every edge of the wave shows the inductance error: Δφ̂/Δi_d.

use fixed::types::{I0F32, I2F30};
use siskin_params::parts;
use siskin_units::math::{Gain, Multiplier, Number, divide};
use siskin_units::{Current, Flux, traced};

traced! {
    /// L over the stated inductance, 0.5 to 1.7.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Factor(I2F30);
}

impl Factor {
    /// The stated inductance.
    pub const ONE: Self = Self(I2F30::ONE);
    const LEAST: I2F30 = I2F30::lit("0.5");
    const GREATEST: I2F30 = I2F30::lit("1.7");

    /// Creates a factor, clamped to its range.
    pub fn new(factor: I2F30) -> Self {
        Self(factor.max(Self::LEAST).min(Self::GREATEST))
    }

    /// Returns the value.
    pub fn get(self) -> I2F30 {
        self.0
    }

    /// Returns `factor` times this, saturating.
    pub fn multiplied<A, B>(self, factor: Multiplier<A, B>) -> Multiplier<A, B> {
        let bits = self.of(I0F32::from_bits(factor.to_bits())).to_bits();
        Multiplier::from_bits(bits)
    }

    /// Returns the product with `x`, saturating.
    #[inline(always)] // in each period
    pub fn of<T: Number>(self, x: T) -> T {
        Gain::from_parts(self.0.to_bits(), 2).held(x)
    }
}

/// Coefficients for one sample period.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    part: parts::AdaptL,
    /// Half the peak-to-peak height of the square wave along d.
    pub amplitude: Current,
    /// Half a wave, in periods.
    pub half_periods: u32,
    /// Periods at the end of each half wave over which current and flux are averaged.
    pub mean_periods: u32,
    /// From Δφ̂/Δi_d to the change of the factor: the gain of a step over the stated L.
    pub gain: Gain<Flux, I2F30>,
}

impl Config {
    /// Creates it without coefficients.
    pub fn new(part: parts::AdaptL) -> Self {
        Self {
            part,
            amplitude: Current::default(),
            half_periods: 0,
            mean_periods: 0,
            gain: Gain::default(),
        }
    }
}

traced! {
    /// The wave, its sums and the factor.
    #[derive(Clone, Debug, PartialEq)]
    pub struct State {
        /// The inductance factor.
        pub factor: Factor,
        /// Periods since the wave's last edge.
        count: u32,
        /// The wave is at its upper level.
        high: bool,
        /// A half wave has ended, so there is one to compare with.
        compares: bool,
        /// Sums of this half wave's last periods.
        now: Sums,
        /// Sums of the previous half wave.
        before: Sums,
    }
}

traced! {
    /// Sums over the same samples, in units of 2^-20: 512 samples of 4 units fit.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    struct Sums {
        i_d: i32,
        flux: i32,
    }
}

/// The most samples in a mean.
pub const MEAN_PERIODS_MAX: u32 = 512;

/// Low bits of a current or flux that a sum drops.
const SUM_SHIFT: u32 = 8;

/// The most that one half wave may change the factor: three times the change that a 30 % error
/// makes, so that a flux transient does not throw it off.
const STEP_MAX: I2F30 = I2F30::lit("0.09");

impl Default for State {
    fn default() -> Self {
        Self {
            factor: Factor::ONE,
            count: 0,
            high: false,
            compares: false,
            now: Sums::default(),
            before: Sums::default(),
        }
    }
}

impl State {
    /// Starts a wave; the factor keeps its value.
    pub fn begin(&mut self) {
        *self = Self {
            factor: self.factor,
            ..Self::default()
        };
    }
}

/// Runs one period on the measured i_d and the estimated flux φ̂ along d; returns the offset to add
/// to i_d*.
#[inline(always)] // in each period
pub fn step(config: &Config, state: &mut State, i_d: Current, flux: Flux) -> Current {
    state.count += 1;
    if state.count > config.half_periods.saturating_sub(config.mean_periods) {
        // Each term is below 4 units of 2^-20, i.e. 2^22: 512 of them fit in 31 bits.
        let part = |bits: i32| bits.clamp(-PART_MAX, PART_MAX) >> SUM_SHIFT;
        state.now.i_d = state.now.i_d.saturating_add(part(i_d.to_bits()));
        state.now.flux = state.now.flux.saturating_add(part(flux.to_bits()));
    }
    if state.count >= config.half_periods {
        edge(config, state);
    }
    if state.high {
        config.amplitude
    } else {
        -config.amplitude
    }
}

/// Four units of 2^-28, less one LSB.
const PART_MAX: i32 = (1 << 30) - 1;

/// Ends a half wave: L̂ += 0.1·Δφ̂/Δi_d, with the one division an edge can afford.
#[cold]
fn edge(config: &Config, state: &mut State) {
    let sums = core::mem::take(&mut state.now);
    let di_d = sums.i_d.saturating_sub(state.before.i_d);
    let dflux = sums.flux.saturating_sub(state.before.flux);
    // The first half wave has no predecessor. A current step below the amplitude, half of the
    // nominal step, says nothing.
    let moved =
        (config.amplitude.to_bits() >> SUM_SHIFT).saturating_mul(config.mean_periods as i32);
    if state.compares && di_d.unsigned_abs() > moved.unsigned_abs() {
        let flux = u64::from(dflux.unsigned_abs()) << Flux::FRAC_NBITS;
        let slope = divide(flux, di_d.unsigned_abs()).min(i32::MAX as u64) as i32;
        let falls = dflux.is_negative() != di_d.is_negative();
        let slope = Flux::from_bits(if falls { -slope } else { slope });
        let step = config.gain.held(slope);
        let step = step.min(STEP_MAX).max(-STEP_MAX);
        state.factor = Factor::new(state.factor.get() + step);
    }
    state.before = sums;
    state.compares = true;
    state.high = !state.high;
    state.count = 0;
}
