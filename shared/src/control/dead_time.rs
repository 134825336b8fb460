//! Compensation of the dead time by the sign of each phase's current.
//!
//! While both switches of a phase are off its current flows through a diode: through the low side's
//! when it flows into the motor, so the phase is low for the dead time of each period in which it
//! should be high, and the other way round. The duty that this takes is the dead time over the
//! period, with the current's sign.

use fixed::types::I1F31;
use fixed::types::I5F27;
use fixed::types::extra::{U27, U31};

use super::transform::{AlphaBeta, phases};
use crate::math::Gain;

/// What the compensation must know.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Phase current to duty: the whole compensation where the current's sign is certain.
    pub slope: Gain<U27, U31>,
    /// The whole compensation: dead time over period.
    pub duty: I1F31,
}

/// What is added to each phase's duty.
///
/// `current` is the vector of the current's reference in the stator's frame: it has no noise, and
/// what it lags or leads by is below the width around zero in which the compensation is in
/// proportion, because there a ripple crosses zero within the period.
#[inline(always)]
pub fn compensation(config: &Config, current: AlphaBeta<I5F27>) -> [I1F31; 3] {
    phases(current).map(|current| {
        let share = config.slope.saturating_apply(current);
        share.min(config.duty).max(-config.duty)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    /// 0.5 µs of 66.7 µs, in full from 0.3 of the unit of current on.
    fn config() -> Config {
        Config {
            slope: Gain::new(0.0075 / 0.3).expect("in range"),
            duty: I1F31::from_num(0.0075),
        }
    }

    fn at(length: f64, degrees: i32) -> [f64; 3] {
        let (sin, cos) = (f64::from(degrees) / 360.0 * TAU).sin_cos();
        let current = AlphaBeta {
            alpha: I5F27::from_num(length * cos),
            beta: I5F27::from_num(length * sin),
        };
        compensation(&config(), current).map(I1F31::to_num)
    }

    #[test]
    fn each_phase_gets_the_sign_of_its_current_and_less_around_zero() {
        for degrees in 0..360 {
            for length in [0.1, 1.0, 7.0] {
                let made = at(length, degrees);
                for (phase, made) in made.into_iter().enumerate() {
                    let angle = f64::from(degrees) / 360.0 - phase as f64 / 3.0;
                    let current = length * (TAU * angle).cos();
                    let wanted = 0.0075 * (current / 0.3).clamp(-1.0, 1.0);
                    assert!((made - wanted).abs() < 1e-6, "{made} for {wanted}");
                }
            }
        }
    }

    #[test]
    fn no_current_needs_none_and_the_longest_vector_does_not_wrap() {
        assert_eq!(at(0.0, 0), [0.0; 3]);
        let most = AlphaBeta {
            alpha: I5F27::from_num(7.99),
            beta: I5F27::from_num(-7.99),
        };
        let [a, b, c] = compensation(&config(), most).map(|x| x.to_num::<f64>());
        let whole = 0.0075;
        assert!((a - whole).abs() < 1e-6 && (b + whole).abs() < 1e-6 && (c - whole).abs() < 1e-6);
    }
}
