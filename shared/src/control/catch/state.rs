//! Configuration and state of the observation.

use fixed::types::{I0F32, I17F15, I20F12};
use siskin_units::{AdcCounts, Angle, Speed, traced};

use super::compare::Difference;

/// Periods from look to look.
pub const LOOK_PERIODS: u32 = 1 << LOOK_SHIFT;

pub(super) const LOOK_SHIFT: u32 = 2;

/// The observer's coefficients.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Amplitude of the back-EMF for the stated flux, in terminal counts with 8 fraction bits, over the speed in
    /// turns per period.
    pub emf: u32,
    /// Forward drop of a diode.
    pub diode: AdcCounts,
    /// Noise times the amplitude per radian per look, counts²: (E/|ω|)·σ, for the initial uncertainty of the speed.
    pub prior: u32,
    /// Slowest forgetting, a share per look.
    pub forget_min: I0F32,
    /// Mean highest reading below which the rotor stands, or turns slowly enough to align.
    pub standing: AdcCounts,
    /// Weight of a new look in that mean.
    pub level_share: I0F32,
    /// Consecutive looks that must fit before the rotor counts as known.
    pub sure_looks: u32,
    /// Looks that may fail to fit before the observation restarts.
    pub lost_looks: u32,
}

traced! {
    /// The part of a look that runs in a period.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub(super) enum Stage {
        /// Compares the readings with the prediction.
        Compare,
        /// Computes the gains of the angle and speed corrections.
        Gains,
        /// Corrects angle, speed and amplitude.
        Correct,
        /// Judges whether everything fits.
        CheckFit,
    }
}

traced! {
    /// State from sample to sample.
    #[derive(Clone, Debug, PartialEq)]
    pub struct State {
        /// Mean of the highest reading.
        pub(super) level: AdcCounts,
        /// This period's stage.
        pub(super) stage: Stage,
        /// Sum of the readings since the last look.
        pub(super) readings: [I17F15; 3],
        /// Looks of this observation; 0 while there is none.
        pub(super) looks: u32,
        /// θ_e, the angle of the back-EMF vector at this sample.
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
        /// Mean of the error magnitudes, summed over the phases.
        pub(super) residual: I17F15,
        /// Result of the last look.
        pub(super) difference: Difference,
        /// k_ω, 30 fraction bits.
        pub(super) speed_gain: i32,
        /// S_1/S_0, looks with 12 fraction bits.
        pub(super) mean_age: i32,
        /// Consecutive looks that fitted.
        pub(super) fits: u32,
        /// Looks that did not.
        pub(super) misfits: u32,
    }
}

impl State {
    /// Creates the state in which nothing is known.
    pub fn new(config: &Config) -> Self {
        Self {
            // Twice the threshold, which tells a resting rotor from one not yet seen.
            level: config.standing.saturating_mul_int(2),
            stage: Stage::Compare,
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
            fits: 0,
            misfits: 0,
        }
    }

    /// Restarts the observation; keeps the mean that tells a resting rotor.
    pub fn restart(&mut self) {
        self.stage = Stage::Compare;
        self.looks = 0;
        self.omega = Speed::ZERO;
        self.residual = I17F15::ZERO;
        self.fits = 0;
        self.misfits = 0;
    }
}

impl State {
    /// Returns true if the next sample will be compared with the prediction for a tracked rotor. The one after it
    /// will not.
    pub fn is_compare_due(&self) -> bool {
        self.stage == Stage::Compare && self.looks >= 2
    }

    /// Returns true if this period only checks the fit of a look: the shortest.
    pub fn is_check_due(&self) -> bool {
        self.stage == Stage::CheckFit
    }

    /// Returns true if the last period has corrected a turning rotor's motion by a look: with a snapshot of the state that
    /// takes no longer than a comparison.
    pub fn has_corrected(&self) -> bool {
        self.stage == Stage::CheckFit
    }

    /// Returns true if looks use the mean of four readings.
    pub(super) fn is_slow(&self) -> bool {
        self.omega.saturating_abs() < SLOW
    }

    /// Returns true if there is no vector yet, or a large one without a speed. For a large back-EMF the difference
    /// of two vectors gives the speed, because a prediction from standstill may be too far off; a small one means a
    /// slow rotor and is too noisy for that.
    pub(super) fn is_acquiring(&self, config: &Config) -> bool {
        self.looks == 0 || self.looks == 1 && self.amplitude >> 1 > config.diode
    }
}

/// Fraction bits of the sums.
pub(super) const SUM_FRACTION: u32 = 12;

/// Speed below which the mean of four readings is as good as one: 3° per period.
const SLOW: Speed = Speed::lit("0.0078125");
