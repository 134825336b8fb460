//! The outer loop: from the wanted speed, current or share of the supply to the duty of the switching leg.
//!
//! Between commutations the duty is the voltage across two phases. With commutation in step with the back-EMF that
//! voltage sets the speed (first paper, section III.B), so a PI on the speed outputs the duty itself, and the
//! current is only bounded. Gains are relative to the maximum speed and the current bound, not to the motor.

use fixed::types::I1F31;

use crate::control::speed::Bounds;
use crate::math::{Gain, Held};
use crate::trace::traced;
use crate::units::{Current, Duty, Speed};

/// log2 of the time constant, in periods, with which the current's peak decays: longer than a sextant whose ripple
/// is too fast to regulate away.
const PEAK_SHIFT: u32 = 6;

/// How many times farther a current regulator's lead may go towards zero, where the limit makes its mean fall short:
/// with 1 the gimbal bench's flux is identified 2.5 % wrong.
const REGULATING: i32 = 2;

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// From speed to duty.
    pub k_p: Gain<Speed, I1F31>,
    /// From speed to duty per period.
    pub k_i: Gain<Speed, I1F31>,
    /// From the current's distance to its bound to the largest duty change per period.
    pub k_b: Gain<Current, I1F31>,
    /// Greatest lead towards zero current, so that the current lost at a commutation is not taken for a trend.
    pub lead_to_zero: Current,
    /// Largest duty; the remainder is the low-side on-time in which the sample falls.
    pub duty_max: I1F31,
}

traced! {
    /// The loop's state.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// The previous period's duty, 0 to `duty_max`.
        pub duty: I1F31,
        /// The speed regulator's integral.
        pub sigma: I1F31,
        /// The current after a low-pass of eight periods.
        pub smoothed: Current,
        /// Peak of the current's magnitude, slowly decaying.
        pub peak: Current,
    }
}

/// Limits of the duty in this period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest duty; below it the current would fall under its bound.
    pub least: I1F31,
    /// Largest duty.
    pub greatest: I1F31,
}

impl State {
    /// Returns by how much the current's peaks exceed its mean. A bound on phase current applies to the peaks, and
    /// between commutations the back-EMF, and with it the current, dips and rises.
    pub fn ripple(&self) -> Current {
        self.peak
            .minus(self.smoothed.saturating_abs())
            .max(Current::ZERO)
    }

    /// Returns the duty for the bridge.
    pub fn for_bridge(&self) -> Duty {
        Duty::from_bits(self.duty.max(I1F31::ZERO).to_bits() as u32)
    }
}

/// Returns the range that keeps the current `i` within its bounds: the more headroom the current has, the faster
/// the duty may change; beyond a bound it turns back.
///
/// With `min` = `max` the range is a single value: a current regulator. A lead of three times the current's deviation
/// from its smoothed value looks some 25 periods ahead, which damps motors whose current responds slowly. Towards zero
/// the lead is limited: where the inductance is low, a commutation takes half of the current within a period. The
/// current recovers by itself, and a duty raised against the loss would drive it far beyond its bound.
pub fn range(config: &Config, state: &mut State, i: Current, bounds: Bounds) -> Range {
    let change = i.minus(state.smoothed);
    state.smoothed = state.smoothed.plus(change >> 3);
    let forgotten = state.peak >> PEAK_SHIFT;
    state.peak = state.peak.minus(forgotten).max(i.saturating_abs());
    let lead = change.saturating_mul_int(3);
    let most = if bounds.min < bounds.max {
        config.lead_to_zero
    } else {
        config.lead_to_zero.saturating_mul_int(REGULATING)
    };
    let lead = if i < Current::ZERO {
        lead.min(most)
    } else {
        lead.max(-most)
    };
    let ahead = i.plus(lead);
    let until = |bound: Current| {
        let step = config.k_b.held(bound.minus(ahead));
        let duty = state.duty.plus(step);
        duty.max(I1F31::ZERO).min(config.duty_max)
    };
    Range {
        least: until(bounds.min),
        greatest: until(bounds.max),
    }
}

/// Regulates the current, given the range of equal bounds.
pub fn current(state: &mut State, range: Range) {
    state.duty = range.greatest;
}

/// Moves to this share of the supply as far as the range permits.
pub fn share(state: &mut State, share: I1F31, range: Range) {
    state.duty = share.min(range.greatest).max(range.least);
}

/// Regulates the speed; `error` is wanted minus actual. The integral holds while the range limits the duty and the
/// error pushes further.
pub fn speed(config: &Config, state: &mut State, error: Speed, range: Range) {
    let wanted = state.sigma.plus(config.k_p.held(error));
    state.duty = wanted.min(range.greatest).max(range.least);
    let held_below = state.duty < wanted && error > Speed::ZERO;
    let held_above = state.duty > wanted && error < Speed::ZERO;
    if !(held_below || held_above) {
        let sigma = state.sigma.plus(config.k_i.held(error));
        state.sigma = sigma.max(I1F31::ZERO).min(config.duty_max);
    }
}

/// Starts speed regulation bumplessly from the present duty.
pub fn take_over(state: &mut State) {
    state.sigma = state.duty;
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT_A: f64 = 20.0;

    /// Gains for a bound of 20 A at 40 kHz and a full speed of 0.03 turns per period.
    fn config() -> Config {
        Config {
            k_p: Gain::new(1.0 / 0.03).expect("in range"),
            k_i: Gain::new(5e-4 / 0.03).expect("in range"),
            k_b: Gain::new(0.008 / LIMIT_A as f32 * 20.0).expect("in range"),
            lead_to_zero: amperes(LIMIT_A / 8.0),
            duty_max: I1F31::from_num(0.92),
        }
    }

    /// One unit of current is 20 A.
    fn amperes(a: f64) -> Current {
        Current::from_num(a / LIMIT_A)
    }

    fn bounds(min_a: f64, max_a: f64) -> Bounds {
        Bounds {
            min: amperes(min_a),
            max: amperes(max_a),
        }
    }

    /// Two phases in series at the bridge, with one period of delay.
    struct Winding {
        supply_v: f64,
        r_ohm: f64,
        l_h: f64,
        emf_v: f64,
        i_a: f64,
        applied: f64,
    }

    impl Winding {
        fn period(&mut self, duty: I1F31) {
            let settled = (self.applied * self.supply_v - self.emf_v) / self.r_ohm;
            self.i_a = settled + (self.i_a - settled) * (-self.r_ohm / self.l_h * 25e-6).exp();
            self.applied = duty.to_num();
        }

        /// A period at this share, as far as the current's bounds permit.
        fn share(&mut self, config: &Config, state: &mut State, wanted: I1F31, bounds: Bounds) {
            let range = range(config, state, amperes(self.i_a), bounds);
            share(state, wanted, range);
            self.period(state.duty);
        }
    }

    #[test]
    fn full_share_from_rest_stays_below_1_2_times_the_limit_for_motors_of_any_kind() {
        // The bench; a racing motor with a tenth of its resistance at 25 V; a gimbal motor.
        for (r_ohm, l_h) in [(0.216, 61.2e-6), (0.03, 20e-6), (4.0, 2e-3)] {
            let (config, mut state) = (config(), State::default());
            let mut winding = Winding {
                supply_v: 25.0,
                r_ohm,
                l_h,
                emf_v: 0.0,
                i_a: 0.0,
                applied: 0.0,
            };
            let mut most = 0.0_f64;
            for _ in 0..4000 {
                winding.share(&config, &mut state, config.duty_max, bounds(-5.0, 20.0));
                most = most.max(winding.i_a);
            }
            assert!(most < 1.2 * LIMIT_A, "{r_ohm}: {most}");
            let expected = LIMIT_A.min(0.92 * 25.0 / r_ohm);
            assert!(
                (winding.i_a - expected).abs() < 0.2,
                "{r_ohm}: {}",
                winding.i_a
            );
        }
    }

    #[test]
    fn a_current_halved_by_a_commutation_overshoots_by_less_than_a_fifth() {
        let (config, mut state) = (config(), State::default());
        // Two phases of 29 mΩ and 7.6 µH at 48 V.
        let mut winding = Winding {
            supply_v: 48.0,
            r_ohm: 0.058,
            l_h: 15.2e-6,
            emf_v: 6.0,
            i_a: 0.0,
            applied: 0.125,
        };
        state.duty = I1F31::from_num(0.125);
        let mut most = 0.0_f64;
        for period in 0..4000 {
            if period % 400 == 0 {
                winding.i_a /= 2.0;
            }
            winding.share(&config, &mut state, config.duty_max, bounds(-5.0, LIMIT_A));
            most = most.max(winding.i_a);
        }
        // As much as an unknown motor's may; an unlimited lead gives 1.4.
        assert!(most < 1.2 * LIMIT_A, "{most}");
    }

    #[test]
    fn the_range_is_in_order_and_a_single_value_for_a_single_current() {
        for (min_a, max_a) in [(-5.0, LIMIT_A), (18.0, 18.0), (0.0, 0.0), (-5.0, -5.0)] {
            for (before_a, now_a) in [(0.0, 20.0), (20.0, 0.0), (-20.0, 20.0), (20.0, -20.0)] {
                let mut state = State {
                    duty: I1F31::from_num(0.5),
                    smoothed: amperes(before_a),
                    ..State::default()
                };
                let range = range(&config(), &mut state, amperes(now_a), bounds(min_a, max_a));
                assert!(range.least <= range.greatest, "{before_a} to {now_a}");
                assert_eq!(range.least == range.greatest, min_a == max_a);
            }
        }
    }

    #[test]
    fn the_current_is_regulated_both_ways() {
        let (config, mut state) = (config(), State::default());
        let mut winding = Winding {
            supply_v: 24.0,
            r_ohm: 0.216,
            l_h: 61.2e-6,
            emf_v: 8.0,
            i_a: 0.0,
            applied: 0.0,
        };
        for wanted_a in [4.0, -5.0, 0.0] {
            for _ in 0..4000 {
                let bounds = bounds(wanted_a, wanted_a);
                let range = range(&config, &mut state, amperes(winding.i_a), bounds);
                current(&mut state, range);
                winding.period(state.duty);
            }
            assert!((winding.i_a - wanted_a).abs() < 0.05, "{}", winding.i_a);
        }
    }

    #[test]
    fn braking_is_bounded_when_the_share_falls() {
        let (config, mut state) = (config(), State::default());
        let mut winding = Winding {
            supply_v: 24.0,
            r_ohm: 0.216,
            l_h: 61.2e-6,
            emf_v: 12.0,
            i_a: 2.0,
            applied: 0.518,
        };
        state.duty = I1F31::from_num(0.518);
        let mut least = 0.0_f64;
        for _ in 0..4000 {
            winding.share(&config, &mut state, I1F31::ZERO, bounds(-5.0, 20.0));
            least = least.min(winding.i_a);
        }
        assert!(least > -6.0, "{least}");
        assert!((winding.i_a + 5.0).abs() < 0.1, "{}", winding.i_a);
    }

    #[test]
    fn the_speed_settles_without_windup() {
        // The bench's shaft: 24 V give 8880 rpm, 0.0444 turns per period; 46 ms.
        let (config, mut state) = (config(), State::default());
        let (mut speed_now, mut current_a) = (0.0_f64, 0.0_f64);
        let mut most = 0.0_f64;
        let wanted = 0.02;
        for _ in 0..40_000 {
            let range = range(&config, &mut state, amperes(current_a), bounds(-5.0, 20.0));
            let error = Speed::from_num(wanted - speed_now);
            speed(&config, &mut state, error, range);
            let across_v = state.duty.to_num::<f64>() * 24.0 - speed_now / 0.0444 * 24.0;
            current_a = across_v / 0.216;
            speed_now += current_a * 0.216 / 24.0 * 0.0444 * 25e-6 / 0.046;
            most = most.max(speed_now);
        }
        assert!((speed_now / wanted - 1.0).abs() < 0.002, "{speed_now}");
        assert!(most < 1.1 * wanted, "{most}");
    }
}
