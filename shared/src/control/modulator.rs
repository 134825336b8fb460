//! From a voltage vector to three duties: space-vector or sine modulation with a minimum low-side
//! on-time, and the compensation of the dead time.

use fixed::types::{I0F32, I1F31, I4F28, I5F27};

use super::transform::{AlphaBeta, Dq, phases};
use crate::math::{Held, TopProduct, other_leg};
use crate::units::{Duty, Voltage};

/// How the phases' common voltage is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Modulation {
    /// In the middle between the highest and the lowest phase: full line-to-line voltage.
    SpaceVector,
    /// Half the supply: 15 % less voltage and less harmonic content of the common mode.
    Sine,
}

/// What the modulator must know.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// How the common voltage is chosen.
    pub modulation: Modulation,
    /// Greatest duty: what is left is the time for which the low sides must be on, so that their
    /// shunts can be read.
    pub duty_max: I1F31,
    /// Greatest length of the voltage vector as a share of the supply.
    pub vector_max: I1F31,
}

/// The supply of one period and its reciprocal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supply {
    /// Voltage.
    pub bus: Voltage,
    /// 1/V with 28 fraction bits, held at 8.
    pub reciprocal: I4F28,
    /// Longest voltage vector that can be had.
    pub vector_max: Voltage,
}

impl Supply {
    /// The one division of a control period.
    #[inline(always)]
    pub fn new(config: &Config, bus: Voltage) -> Self {
        // 2^56/bus of the voltage's upper bits, right to 2^-11 at the worst, and one Newton step. The
        // floor of 1/8 bounds the reciprocal.
        let bits = bus.to_bits().max(1 << 25);
        let rough = ((u32::MAX / (bits >> 10) as u32) << 14).min(i32::MAX as u32);
        let rough = I4F28::from_bits(rough as i32);
        let product = i64::from(bits) * i64::from(rough.to_bits());
        let error = I0F32::from_bits((((1 << 56) - product) >> 24) as i32);
        Self {
            bus,
            reciprocal: rough.plus(rough.top(error)),
            vector_max: Voltage::from_bits(config.vector_max.top(bus).to_bits() << 1),
        }
    }
}

/// Shortens a voltage vector to what the supply can give, keeping the part along d, which cancels
/// what the current and the speed induce.
///
/// Returns the vector and what was cut off, if it was shortened.
#[inline(always)]
pub fn limit(u: Dq<Voltage>, vector_max: Voltage) -> (Dq<Voltage>, Option<Dq<Voltage>>) {
    let square = |x: Voltage| x.top(x);
    if square(u.d).plus(square(u.q)) <= square(vector_max) {
        (u, None)
    } else {
        let short = shorten(u, vector_max);
        let cut = Dq {
            d: u.d.minus(short.d),
            q: u.q.minus(short.q),
        };
        (short, Some(cut))
    }
}

#[cold]
fn shorten(u: Dq<Voltage>, vector_max: Voltage) -> Dq<Voltage> {
    let d = u.d.min(vector_max).max(-vector_max);
    let q_max = other_leg(vector_max, d);
    Dq {
        d,
        q: u.q.min(q_max).max(-q_max),
    }
}

/// The three duties of a voltage vector that [`limit`] has passed.
///
/// `compensation` is added to each phase's duty: what the dead time takes away.
#[inline(always)]
pub fn duties(
    config: &Config,
    supply: &Supply,
    v: AlphaBeta<I5F27>,
    compensation: [I1F31; 3],
) -> [Duty; 3] {
    // Share of the supply, 23 fraction bits.
    let [a, b, c] = phases(AlphaBeta {
        alpha: v.alpha.top(supply.reciprocal),
        beta: v.beta.top(supply.reciprocal),
    });
    let [ca, cb, cc] = compensation;
    let shares = [(a, ca), (b, cb), (c, cc)].map(|(v, c)| v.to_bits() + (c.to_bits() >> 8));
    let highest = shares[0].max(shares[1]).max(shares[2]);
    let lowest = shares[0].min(shares[1]).min(shares[2]);
    let duty_max = config.duty_max.to_bits() >> 8;
    let common = match config.modulation {
        Modulation::SpaceVector => (duty_max - highest - lowest) >> 1,
        Modulation::Sine => duty_max >> 1,
    };
    shares.map(|share| Duty::from_bits(((share + common).max(0).min(duty_max) as u32) << 8))
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    fn config(modulation: Modulation, duty_max: f64) -> Config {
        let vector = match modulation {
            Modulation::SpaceVector => 1.0 / 3.0_f64.sqrt(),
            Modulation::Sine => 0.5,
        };
        Config {
            modulation,
            duty_max: I1F31::from_num(duty_max),
            vector_max: I1F31::from_num(vector * duty_max),
        }
    }

    /// What the duties make of the supply: the vector without its common part.
    fn vector(duties: [Duty; 3], bus: f64) -> (f64, f64) {
        let [a, b, c] = duties.map(|d| d.to_num::<f64>() * bus);
        ((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt())
    }

    #[test]
    fn the_duties_make_the_vector_up_to_the_limit() {
        for modulation in [Modulation::SpaceVector, Modulation::Sine] {
            let config = config(modulation, 0.95);
            for bus in [0.2, 0.98, 5.0] {
                let supply = Supply::new(&config, Voltage::from_num(bus));
                let most = supply.vector_max.to_num::<f64>();
                for degrees in 0..360 {
                    let (sin, cos) = (f64::from(degrees) / 360.0 * TAU).sin_cos();
                    for length in [0.0, 0.3 * most, 0.999 * most] {
                        let v = AlphaBeta {
                            alpha: I5F27::from_num(length * cos),
                            beta: I5F27::from_num(length * sin),
                        };
                        let made = duties(&config, &supply, v, [I1F31::ZERO; 3]);
                        let (alpha, beta) = vector(made, bus);
                        assert!((alpha - length * cos).abs() < 2e-5 * bus.max(1.0));
                        assert!((beta - length * sin).abs() < 2e-5 * bus.max(1.0));
                        assert!(made.iter().all(|d| *d <= Duty::from_num(0.95)));
                    }
                }
            }
        }
    }

    #[test]
    fn space_vector_centres_the_pulses_between_the_limits() {
        let config = config(Modulation::SpaceVector, 0.9);
        let supply = Supply::new(&config, Voltage::ONE);
        let v = AlphaBeta {
            alpha: I5F27::from_num(0.4),
            beta: I5F27::ZERO,
        };
        let [a, b, c] = duties(&config, &supply, v, [I1F31::ZERO; 3]).map(|d| d.to_num::<f64>());
        assert!((a + b - 0.9).abs() < 1e-5 && (b - c).abs() < 1e-6);
    }

    #[test]
    fn a_vector_that_is_too_long_keeps_its_d() {
        let u = Dq {
            d: Voltage::from_num(-0.3),
            q: Voltage::from_num(2),
        };
        let (limited, cut) = limit(u, Voltage::from_num(0.5));
        let rest = Dq {
            d: Voltage::ZERO,
            q: u.q - limited.q,
        };
        assert_eq!(cut, Some(rest));
        assert_eq!(limited.d, u.d);
        assert!((limited.q.to_num::<f64>() - 0.4).abs() < 1e-6);
        assert_eq!(limit(limited, Voltage::from_num(0.5001)), (limited, None));
    }

    #[test]
    fn compensation_is_added() {
        let config = config(Modulation::Sine, 0.99);
        let supply = Supply::new(&config, Voltage::ONE);
        let extra = [0.01, -0.01, 0.0].map(I1F31::from_num);
        let made = duties(&config, &supply, AlphaBeta::default(), extra);
        let [a, b, c] = made.map(|d| d.to_num::<f64>());
        assert!((a - c - 0.01).abs() < 1e-6 && (c - b - 0.01).abs() < 1e-6);
    }

    #[test]
    fn the_reciprocal_is_right_to_a_millionth() {
        let config = config(Modulation::SpaceVector, 0.95);
        for i in 26..1600 {
            let bus = Voltage::from_num(f64::from(i) * 0.005);
            let product =
                Supply::new(&config, bus).reciprocal.to_num::<f64>() * bus.to_num::<f64>();
            assert!((product - 1.0).abs() < 1e-6, "{bus}: {product}");
        }
    }

    #[test]
    fn no_supply_does_not_divide_by_zero() {
        let config = config(Modulation::SpaceVector, 0.95);
        let supply = Supply::new(&config, Voltage::ZERO);
        assert_eq!(supply.vector_max, Voltage::ZERO);
        assert!(supply.reciprocal > I4F28::from_num(7.9));
    }
}
