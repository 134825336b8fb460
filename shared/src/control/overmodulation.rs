//! Voltage vectors beyond those that all phases can switch: the highest phase stays at the supply.
//!
//! A phase that does not switch needs no low-side on-time: its driver loses no charge to a gate, and its current is minus
//! the sum of the others. So the whole supply lies between the phases. Near the hexagon's corners the second phase, too,
//! would have less on-time than it needs: it keeps its largest duty, and there the vector is a little shorter.
//!
//! Beyond the hexagon the vector is cut, and the fundamental rises to 0.609 of what the highest phase has, with a
//! vector to the hexagon's corners; a six-step's is 0.637: Holtz, "Pulsewidth modulation for electronic power
//! conversion", Proc. IEEE 82 (1994), section IV.

use fixed::types::I1F31;
use siskin_units::math::TopProduct;
use siskin_units::{Duty, TurnedVoltage, Voltage};

use super::modulator::{Config, Phases, whole, whole_duty};
use super::transform::AlphaBeta;

/// More of the period than this beyond the largest duty, 0.4 %, makes the highest phase stay high: not a rounding.
const NO_LONGER: I1F31 = I1F31::from_bits(1 << 23);

/// Returns the three duties of a voltage vector that [`limit`](super::modulator::limit) and [`beyond_hexagon`] have
/// shortened, as [`duties`](super::modulator::duties) does of a short one.
pub fn duties(config: &Config, phases: &Phases) -> [Duty; 3] {
    let Phases {
        shares,
        compensated,
    } = *phases;
    let common = config.common(shares);
    let [a, b, c] = shares;
    let highest = if a >= b && a >= c {
        0
    } else if b >= c {
        1
    } else {
        2
    };
    let over = &config.over;
    // What is left to the highest phase. It is not compensated if it stays high.
    let present = common.wrapping_add(whole(shares[highest]));
    let overmodulates = over.highest != I1F31::ZERO;
    let stays_high = overmodulates && present.wrapping_sub(config.duty_max) > NO_LONGER;
    let common = if stays_high {
        common.wrapping_add(over.highest).wrapping_sub(present)
    } else {
        common
    };
    let most = if overmodulates {
        over.second
    } else {
        config.duty_max
    };
    let duty = |share, most| {
        let duty = common.saturating_add(whole(share)).max(I1F31::ZERO);
        whole_duty(duty.min(most))
    };
    // Not by `map`, which becomes a loop in a build optimised for size.
    let [a, b, c] = compensated;
    let mut made = [duty(a, most), duty(b, most), duty(c, most)];
    made[highest] = if stays_high {
        over.full
    } else {
        duty(compensated[highest], config.duty_max)
    };
    made
}

/// cos 30°.
const COS_30: I1F31 = I1F31::lit("0.866025403784");

/// 1/3.
const THIRD: I1F31 = I1F31::lit("0.333333333333");

/// 1/√3.
const PER_ROOT_3: I1F31 = I1F31::lit("0.577350269190");

/// Returns what to cut off a vector to bring it into the hexagon of what the duties can make: what phases clamped to the
/// supply's two ends lose.
///
/// `linear` is the radius of the hexagon's inscribed circle.
#[inline(never)] // few periods
pub fn beyond_hexagon(
    v: AlphaBeta<TurnedVoltage>,
    linear: Voltage,
) -> Option<AlphaBeta<TurnedVoltage>> {
    let most: TurnedVoltage = linear.top(COS_30).scaled();
    let (x, y): (TurnedVoltage, _) = (v.beta.top(COS_30).scaled(), v.alpha >> 1);
    let (b, c) = (
        x.wrapping_sub(y),
        TurnedVoltage::ZERO.wrapping_sub(x).wrapping_sub(y),
    );
    // Centred, the middle phase's half is common to all.
    let (low, high) = if b < c { (b, c) } else { (c, b) };
    let half = v.alpha.max(low).min(high) >> 1;
    let over = |phase: TurnedVoltage| {
        let centred = phase.wrapping_add(half);
        centred.wrapping_sub(centred.min(most).max(-most))
    };
    let (a, b, c) = (over(v.alpha), over(b), over(c));
    let any = a.to_bits() | b.to_bits() | c.to_bits();
    (any != 0).then(|| AlphaBeta {
        alpha: (a.wrapping_add(a).wrapping_sub(b).wrapping_sub(c))
            .top(THIRD)
            .scaled(),
        beta: b.wrapping_sub(c).top(PER_ROOT_3).scaled(),
    })
}

#[cfg(test)]
mod tests {
    use siskin_params::Shunts::{self, Three, Two};
    use siskin_units::Speed;

    use super::*;
    use crate::control::dead_time;
    use crate::control::modulator::{Modulation, Supply};
    use crate::control::transform::PhaseOrder;
    use core::f64::consts::TAU;

    const MOST: f64 = 0.95;

    fn config(shunts: Shunts, window: f32) -> Config {
        Config::new(Modulation::SpaceVector, MOST as f32, window).overmodulating(
            shunts,
            window,
            Speed::ZERO,
        )
    }

    fn supply(config: &Config) -> Supply {
        let mut supply = Supply::new(config, Voltage::ONE, Voltage::ZERO);
        supply.update_limits_at(config, Voltage::ZERO, Speed::MAX);
        supply
    }

    /// Returns a vector within the hexagon, and the duties that make it.
    fn made(config: &Config, length: f64, degrees: i32) -> ((f64, f64), [f64; 3]) {
        let supply = supply(config);
        let linear = Voltage::from_num(config.linear.to_num::<f64>());
        let (sin, cos) = (f64::from(degrees) / 360.0 * TAU).sin_cos();
        let v = AlphaBeta {
            alpha: TurnedVoltage::from_num(length * cos),
            beta: TurnedVoltage::from_num(length * sin),
        };
        let over = beyond_hexagon(v, linear).unwrap_or_default();
        let v = AlphaBeta {
            alpha: v.alpha - over.alpha,
            beta: v.beta - over.beta,
        };
        // A duty above 1 fills the period.
        let (order, none) = (PhaseOrder::NORMAL, &dead_time::Config::NONE);
        let phases = Phases::new(&supply, v, order, none, AlphaBeta::default());
        let duties = duties(config, &phases).map(|d| d.to_num::<f64>().min(1.0));
        ((v.alpha.to_num(), v.beta.to_num()), duties)
    }

    /// The vector that the duties make of a supply of 1.
    fn vector([a, b, c]: [f64; 3]) -> (f64, f64) {
        ((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt())
    }

    fn second([a, b, c]: [f64; 3]) -> f64 {
        a.max(b).min(a.min(b).max(c))
    }

    /// The more is asked the longer is the fundamental, to 0.6 of what the highest phase has.
    #[test]
    fn the_fundamental_is_what_is_asked_and_rises_towards_a_six_step_s() {
        for (shunts, most) in [(Three, 1.0), (Two, MOST)] {
            let config = config(shunts, MOST as f32);
            let longest = supply(&config).longest.length().to_num::<f64>();
            let mut before = 0.0;
            for step in 1..=40 {
                let length = longest * f64::from(step) / 40.0;
                let mut fundamental = 0.0;
                for degrees in 0..360 {
                    let (_, duties) = made(&config, length, degrees);
                    let (alpha, beta) = vector(duties);
                    let (sin, cos) = (f64::from(degrees) / 360.0 * TAU).sin_cos();
                    fundamental += (alpha * cos + beta * sin) / 360.0;
                }
                assert!(fundamental > before, "{length}: {fundamental}");
                before = fundamental;
            }
            assert!(before > 0.605 * most, "{shunts:?}: {before}");
        }
    }

    /// Only the highest phase may go unread.
    #[test]
    fn the_duties_make_the_vector_where_the_second_phase_has_its_window() {
        for (shunts, window) in [(Three, 0.9), (Three, MOST), (Two, MOST)] {
            let config = config(shunts, window as f32);
            for length in [0.1, 0.5, 0.55, 0.56, 0.57, 0.58, 0.6, 0.65] {
                for degrees in 0..360 {
                    let (wanted, duties) = made(&config, length, degrees);
                    let (alpha, beta) = vector(duties);
                    let error = (alpha - wanted.0).hypot(beta - wanted.1);
                    let second = second(duties);
                    let highest = duties.into_iter().fold(0.0, f64::max);
                    // Both ends may lack what is not worth staying high for.
                    let rounded = (highest - MOST).abs() < 1e-6 && error < 2.0 / 256.0;
                    assert!(
                        error < 2e-5 || second > window - 1e-6 || rounded,
                        "{shunts:?} {window} {length} at {degrees}: {error} {duties:?}"
                    );
                    // Two thirds of what the second phase lacks.
                    assert!(error < 0.667 * (1.0 - window) + 1e-5, "{error}");
                    assert!(second < window + 1e-6 || length < 0.55, "{duties:?}");
                    let whole = duties.iter().any(|&duty| duty > MOST + 1e-6);
                    assert!(!whole || (shunts == Three && length > MOST / 3.0_f64.sqrt()));
                }
            }
        }
    }

    #[test]
    fn a_slow_rotor_s_vectors_switch_every_phase() {
        let config = Config::new(Modulation::SpaceVector, MOST as f32, MOST as f32).overmodulating(
            Three,
            MOST as f32,
            Speed::from_num(0.01),
        );
        let mut supply = supply(&config);
        let longest = supply.longest.length();
        supply.update_limits_at(&config, Voltage::ZERO, Speed::from_num(0.009));
        assert!(supply.longest.length() < longest);
        let most = MOST / 3.0_f64.sqrt();
        assert!((supply.longest.length().to_num::<f64>() - most).abs() < 1e-6);
    }

    #[test]
    fn without_overmodulation_no_duty_exceeds_the_largest() {
        let config = Config::new(Modulation::SpaceVector, MOST as f32, MOST as f32);
        let (_, duties) = made(&config, 0.65, 10);
        assert!(duties.iter().all(|&duty| duty < MOST + 1e-6), "{duties:?}");
    }
}
