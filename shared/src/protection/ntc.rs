//! Temperature from a thermistor reading.

use siskin_units::AdcCounts;
use siskin_units::math::{Real, logarithm};

/// Counts of a 12-bit ADC.
const COUNTS: f32 = 4096.0;

/// 0 °C, K.
const FREEZING_K: f32 = 273.15;

/// An NTC thermistor between the ADC's reference and its input, with a resistor from there to
/// ground, by its β: at T kelvins its resistance is r₂₅·e^(β·(1/T − 1/298.15)), so a warmer one
/// reads higher.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ntc {
    /// The resistor to ground over the thermistor's resistance at 25 °C.
    pub pull_down: f32,
    /// β, K.
    pub beta_k: f32,
}

impl Ntc {
    /// The VESC's transistor thermistor: 10 kΩ at 25 °C, β 3434 K, over 10 kΩ.
    pub const VESC: Self = Self {
        pull_down: 1.0,
        beta_k: 3434.0,
    };

    /// Returns the temperature of a reading, °C; NaN if the thermistor is open or shorted.
    ///
    /// For the tasks, about once per millisecond: it takes a logarithm.
    pub fn celsius(&self, reading: AdcCounts) -> f32 {
        let counts = reading.to_f32();
        if counts <= 1.0 || counts >= COUNTS - 1.0 {
            return f32::NAN;
        }
        let ratio = self.pull_down * (COUNTS - counts) / counts;
        let inverse = 1.0 / (FREEZING_K + 25.0) + logarithm(ratio) / self.beta_k;
        1.0 / inverse - FREEZING_K
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_the_reference_is_25_degrees_and_more_is_warmer() {
        let celsius = |counts: i32| Ntc::VESC.celsius(AdcCounts::from_num(counts));
        assert!((celsius(2048) - 25.0).abs() < 1e-3);
        // 3434·(1/373.15 − 1/298.15) = −2.3149: 0.0988 of 10 kΩ, 3727.8 counts.
        assert!((celsius(3728) - 100.0).abs() < 0.1);
        assert!(celsius(1000) < 5.0);
    }

    #[test]
    fn a_thermistor_that_is_torn_off_or_shorted_has_no_temperature() {
        for counts in [0, 1, 4095] {
            assert!(Ntc::VESC.celsius(AdcCounts::from_num(counts)).is_nan());
        }
    }
}
