//! The configuration and the state of the observation.

use fixed::types::{I0F32, I17F15, I20F12};

use super::compare::Difference;
use crate::trace::traced;
use crate::units::{AdcCounts, Angle, Speed};

/// Periods from look to look.
pub const LOOK_PERIODS: u32 = 1 << LOOK_SHIFT;

pub(super) const LOOK_SHIFT: u32 = 2;

/// The observer's coefficients.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Back-EMF's amplitude that the stated flux gives, in counts of the terminals with 8 fraction
    /// bits, over the speed in turns a period.
    pub emf: u32,
    /// A diode's drop.
    pub diode: AdcCounts,
    /// Noise times the amplitude a radian per look, counts²: (E/|ω|)·σ, which makes the first
    /// guess of the speed's uncertainty.
    pub prior: u32,
    /// Slowest forgetting, a share a look.
    pub forget_min: I0F32,
    /// Mean of the highest reading below which the rotor stands, or turns so slowly that it can be
    /// aligned.
    pub standing: AdcCounts,
    /// Share of a new look in that mean.
    pub level_share: I0F32,
    /// Looks in a row for which all must fit before the rotor is known.
    pub sure_looks: u32,
    /// Looks for which something may not fit before the observation begins anew.
    pub lost_looks: u32,
}

traced! {
    /// A period's part in a look.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub(super) enum Stage {
        /// It compares the readings with the prediction.
        Look,
        /// It finds by how much angle and speed are to be corrected for what differs.
        Weigh,
        /// It corrects them, and the amplitude.
        Correct,
        /// It sees whether all fits.
        Judge,
    }
}

traced! {
    /// The state from sample to sample.
    #[derive(Clone, Debug, PartialEq)]
    pub struct State {
        /// Mean of the highest reading.
        pub(super) level: AdcCounts,
        /// This period's part.
        pub(super) stage: Stage,
        /// Sum of the readings after the last look.
        pub(super) readings: [I17F15; 3],
        /// Looks of this observation; 0 while there is none.
        pub(super) looks: u32,
        /// θ_e, the angle of the back-EMF's vector at this sample.
        pub(super) theta: Angle,
        /// ω.
        pub(super) omega: Speed,
        /// E, in counts.
        pub(super) amplitude: AdcCounts,
        /// S_0.
        pub(super) weight: I20F12,
        /// S_1 and S_2, 12 fraction bits.
        pub(super) ages: [i64; 2],
        /// Sum of the weights of E.
        pub(super) amplitude_weight: I20F12,
        /// Sum of the squared ages about their mean, looks².
        pub(super) spread: u32,
        /// Mean of the errors' magnitudes, summed over the phases.
        pub(super) residual: I17F15,
        /// The result of the last look.
        pub(super) difference: Difference,
        /// k_ω, 30 fraction bits.
        pub(super) speed_gain: i32,
        /// S_1/S_0, looks with 12 fraction bits.
        pub(super) mean_age: i32,
        /// Looks in a row for which all fitted.
        pub(super) fitting: u32,
        /// Looks for which something did not.
        pub(super) unfitting: u32,
    }
}

impl State {
    /// Nothing known.
    pub fn new(config: &Config) -> Self {
        Self {
            // Twice the threshold: a resting rotor is told from one that has not been seen.
            level: config.standing.saturating_mul_int(2),
            stage: Stage::Look,
            readings: [I17F15::ZERO; 3],
            looks: 0,
            theta: Angle::ZERO,
            omega: Speed::ZERO,
            amplitude: AdcCounts::ZERO,
            weight: I20F12::ZERO,
            ages: [0; 2],
            amplitude_weight: I20F12::ZERO,
            spread: 0,
            residual: I17F15::ZERO,
            difference: Difference::default(),
            speed_gain: 0,
            mean_age: 0,
            fitting: 0,
            unfitting: 0,
        }
    }

    /// Begins anew, but for the mean that tells a resting rotor.
    pub fn restart(&mut self) {
        self.stage = Stage::Look;
        self.looks = 0;
        self.omega = Speed::ZERO;
        self.residual = I17F15::ZERO;
        self.fitting = 0;
        self.unfitting = 0;
    }
}

impl State {
    /// Returns true if the next sample is compared with what is expected of a rotor that is followed. The one after
    /// it is not.
    pub fn is_looking(&self) -> bool {
        self.stage == Stage::Look && self.looks >= 2
    }

    /// Returns true if looks are at the mean of four readings.
    pub(super) fn is_slow(&self) -> bool {
        self.omega.saturating_abs() < SLOW
    }

    /// Returns true if there is no vector yet, or a large one and no speed: of a large back-EMF the
    /// difference of two vectors is the speed, since the prediction of a rotor at rest may be too far
    /// off. A small one is of a slow rotor, and too noisy for that.
    pub(super) fn seeks(&self, config: &Config) -> bool {
        self.looks == 0 || self.looks == 1 && self.amplitude >> 1 > config.diode
    }
}

/// Fraction bits of the sums.
pub(super) const SUM_FRACTION: u32 = 12;

/// Speed below which the mean of four readings is as good as one: 3° a period.
const SLOW: Speed = Speed::lit("0.0078125");
