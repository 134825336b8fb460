//! Adaptation of the inductance: a wrong L̂ turns the estimated rotor by asin(ΔL·i_q/φ), and it
//! cannot be seen at constant current.
//!
//! i_d* carries a square wave. Along d an observer that takes ψ − L̂·i for the rotor's flux sees
//! φ̂ = φ + (L − L̂)·i_d, so each of the wave's edges shows the inductance's error: Δφ̂/Δi_d.

use fixed::types::{I0F32, I2F30};

use crate::math::{Gain, Multiplier, Number, divide};
use crate::trace::traced;
use crate::units::{Current, Flux};

traced! {
    /// L over the inductance that the parameters state, within 0.5 to 1.7.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Factor(I2F30);
}

impl Factor {
    /// As stated.
    pub const ONE: Self = Self(I2F30::ONE);
    const LEAST: I2F30 = I2F30::lit("0.5");
    const GREATEST: I2F30 = I2F30::lit("1.7");

    /// A factor, held at the ends of its range.
    pub fn new(factor: I2F30) -> Self {
        Self(factor.max(Self::LEAST).min(Self::GREATEST))
    }

    /// The factor's value.
    pub fn get(self) -> I2F30 {
        self.0
    }

    /// A factor times this, held at the ends of its type.
    pub fn multiplied<A, B>(self, factor: Multiplier<A, B>) -> Multiplier<A, B> {
        let bits = self.of(I0F32::from_bits(factor.to_bits())).to_bits();
        Multiplier::from_bits(bits)
    }

    /// The product with `x`, held at the ends of its type.
    #[inline(always)] // in each period
    pub fn of<T: Number>(self, x: T) -> T {
        Gain::from_parts(self.0.to_bits(), 2).saturating_apply(x)
    }
}

/// Coefficients for one sample period.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Half the height of the square wave along d.
    pub amplitude: Current,
    /// Periods of half a wave.
    pub half_periods: u32,
    /// Periods at the end of it over which current and flux are averaged.
    pub mean_periods: u32,
    /// Flux over current to what the factor moves by: the gain of a step, over the stated L.
    pub gain: Gain<Flux, I2F30>,
}

traced! {
    /// The wave, its sums and the factor.
    #[derive(Clone, Debug, PartialEq)]
    pub struct State {
        /// The factor of the inductance.
        pub factor: Factor,
        /// Periods since the wave's last edge.
        count: u32,
        /// True while the wave is at its upper level.
        high: bool,
        /// True once a half wave has ended.
        compares: bool,
        /// Over the last periods of this half wave.
        now: Sums,
        /// Of the half wave before.
        before: Sums,
    }
}

traced! {
    /// Sums over the same samples, in 2^-20 of a unit: 512 samples of 4 units fit.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    struct Sums {
        i_d: i32,
        flux: i32,
    }
}

/// Greatest number of samples in a mean.
pub const MEAN_PERIODS_MAX: u32 = 512;

/// Bits of a current or a flux that a sum leaves out.
const SUM_SHIFT: u32 = 8;

/// Most that one half wave may move the factor: three times what an error of 30 % moves it, so that
/// a transient of the flux does not throw it off.
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
    /// Begins a wave; the factor stays what it has become.
    pub fn begin(&mut self) {
        *self = Self {
            factor: self.factor,
            ..Self::default()
        };
    }
}

/// One period: takes the measured i_d and the estimated flux φ̂ along d, and returns what is added
/// to i_d*.
#[inline(always)] // in each period
pub fn step(config: &Config, state: &mut State, i_d: Current, flux: Flux) -> Current {
    state.count += 1;
    if state.count > config.half_periods.saturating_sub(config.mean_periods) {
        // Each part is below 4 units of 2^-20, 2^22: 512 of them stay in 31 bits.
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

/// Four units of 2^-28, less one.
const PART_MAX: i32 = (1 << 30) - 1;

/// The end of half a wave: L̂ += 0.1·Δφ̂/Δi_d, with the one division that an edge may take.
#[cold]
fn edge(config: &Config, state: &mut State) {
    let sums = core::mem::take(&mut state.now);
    let di_d = sums.i_d.saturating_sub(state.before.i_d);
    let dflux = sums.flux.saturating_sub(state.before.flux);
    // The first half wave has nothing before it, and a current that has hardly moved says nothing:
    // less than the amplitude, of the two that it should move by.
    let moved =
        (config.amplitude.to_bits() >> SUM_SHIFT).saturating_mul(config.mean_periods as i32);
    if state.compares && di_d.unsigned_abs() > moved.unsigned_abs() {
        let flux = u64::from(dflux.unsigned_abs()) << Flux::FRAC_NBITS;
        let slope = divide(flux, di_d.unsigned_abs()).min(i32::MAX as u64) as i32;
        let falls = dflux.is_negative() != di_d.is_negative();
        let slope = Flux::from_bits(if falls { -slope } else { slope });
        let step = config.gain.saturating_apply(slope);
        let step = step.min(STEP_MAX).max(-STEP_MAX);
        state.factor = Factor::new(state.factor.get() + step);
    }
    state.before = sums;
    state.compares = true;
    state.high = !state.high;
    state.count = 0;
}
