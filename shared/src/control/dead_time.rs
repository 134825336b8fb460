//! Dead-time compensation by the sign of each phase's current.
//!
//! While both switches of a leg are off, the phase's current flows through a diode. Current into the motor
//! takes the low side's, so the phase is low for the dead time of every period in which it should be high;
//! negative current does the opposite. The lost duty is the dead time over the period, plus a little for the
//! diode's forward drop, with the current's sign.

use fixed::FixedI32;
use fixed::types::extra::{U22, U25};
use fixed::types::{I2F30, I6F26, I8F24, I12F20};
use siskin_units::Current;
use siskin_units::math::{Gain, SinCos, TopSum};

use super::transform::{Dq, rotate};

/// A share of the supply voltage.
pub type Share = FixedI32<U22>;

/// Coefficients of the compensation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Phase current over the smallest current whose sign is certain.
    pub certainty: Gain<Current, I12F20>,
    /// The full compensation: dead time over period, plus the diodes' part.
    pub duty: I2F30,
    /// The bridge's dead time over the period.
    pub share: I2F30,
}

/// A current over the smallest one whose sign is certain, in the rotor's frame, rotated to where that frame
/// will be in the middle of the voltage.
pub type Certainty = Dq<FixedI32<U25>>;

/// Returns the certainty of the reference current, which carries no noise. The error by which it lags or leads
/// is smaller than the proportional zone around zero, where the ripple crosses zero within a period. Called
/// every few periods; `delay_rotation` is the frame's rotation until the voltage acts.
pub fn certainty(config: &Config, reference: Dq<Current>, delay_rotation: SinCos) -> Certainty {
    let d = config.certainty.held(reference.d).to_bits();
    let q = config.certainty.held(reference.q).to_bits();
    // Shifts less where the result would exceed its type, ±32; beyond that the proportional zone widens in
    // proportion.
    let room = (magnitude(d) | magnitude(q)).leading_zeros() - 1;
    let shift = room.min(MORE_BITS);
    let scaled = Dq {
        d: I6F26::from_bits(d << shift),
        q: I6F26::from_bits(q << shift),
    };
    rotate(scaled, delay_rotation)
}

/// Extra fraction bits of a certainty over its gain's output.
const MORE_BITS: u32 = 6;

/// The magnitude, one less for a negative value: only its leading zeros matter.
#[inline(always)] // in each period
fn magnitude(bits: i32) -> u32 {
    (bits ^ (bits >> 31)) as u32
}

impl Config {
    /// No dead time.
    pub const NONE: Self = Self {
        certainty: Gain::ZERO,
        duty: I2F30::ZERO,
        share: I2F30::ZERO,
    };

    /// Returns a phase's share of the supply plus what the dead time takes from it, for this certainty of its
    /// current's sign.
    #[inline(always)] // in each period
    pub fn compensated(&self, share: Share, certainty: I8F24) -> Share {
        let sign = certainty.to_bits().clamp(-CERTAIN, CERTAIN - 1);
        share.plus_top(I8F24::from_bits(sign), self.duty)
    }
}

/// One with 24 fraction bits.
const CERTAIN: i32 = 1 << 24;

#[cfg(test)]
mod tests {
    use siskin_units::Angle;
    use siskin_units::math::sin_cos;

    use super::*;
    use crate::control::transform::{AlphaBeta, inverse_park, phases};
    use core::f64::consts::TAU;

    /// 0.5 µs of 66.7 µs, in full from 0.3 units of current up.
    fn config() -> Config {
        Config {
            certainty: Gain::new(1.0 / 0.3).expect("in range"),
            duty: I2F30::from_num(0.0075),
            ..Config::NONE
        }
    }

    /// Returns the voltage to add to each phase.
    fn made(config: &Config, certainty: AlphaBeta<I8F24>) -> [f64; 3] {
        phases(certainty).map(|x| config.compensated(Share::ZERO, x).to_num())
    }

    fn at(length: f64, degrees: i32) -> [f64; 3] {
        let angle =
            |share: f64| sin_cos(Angle::wrapping_from_num(f64::from(degrees) * share / 360.0));
        let current = Dq {
            d: Current::from_num(length),
            q: Current::ZERO,
        };
        let seen = certainty(&config(), current, angle(0.25));
        made(&config(), inverse_park(seen, angle(0.75)))
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
                    // Each of the two sines is up to 8e-5 short.
                    assert!((made - wanted).abs() < 1.3e-6, "{made} for {wanted}");
                }
            }
        }
    }

    #[test]
    fn no_current_needs_none_and_the_longest_vector_does_not_wrap() {
        assert_eq!(at(0.0, 0), [0.0; 3]);
        let config = Config {
            certainty: Gain::new(1000.0).expect("in range"),
            ..config()
        };
        let most = Dq {
            d: Current::from_num(7.99),
            q: Current::from_num(-7.99),
        };
        let seen = certainty(&config, most, sin_cos(Angle::ZERO));
        let [a, b, c] = made(&config, inverse_park(seen, sin_cos(Angle::ZERO)));
        let whole = 0.0075;
        assert!((a - whole).abs() < 1e-6 && (b + whole).abs() < 1e-6 && (c - whole).abs() < 1e-6);
    }
}
