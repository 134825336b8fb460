//! The outer loop: from the wanted speed, current or share of the supply to the duty of the switching leg.
//!
//! Between commutations the duty is the voltage across two phases. With commutation in step with the back-EMF that
//! voltage sets the speed (first paper, section III.B), so a PI on the speed outputs the duty itself, and the
//! current is only bounded. Gains are relative to the maximum speed and the current bound, not to the motor.

use fixed::types::I1F31;
use siskin_units::math::{Gain, Held};
use siskin_units::{Current, Duty, Speed, traced};

use crate::control::speed::Bounds;

/// log2 of the time constant, in periods, with which the current's peak decays: longer than a sextant whose ripple
/// is too fast to regulate away.
const PEAK_SHIFT: u32 = 6;

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// From speed to duty.
    pub k_p: Gain<Speed, I1F31>,
    /// From speed to duty per period of the outer loop.
    pub k_i: Gain<Speed, I1F31>,
    /// From the current's distance to its bound to the largest duty change per period.
    pub k_b: Gain<Current, I1F31>,
    /// Greatest lead towards zero current, so that the current lost at a commutation is not taken for a trend.
    pub lead_to_zero_max: Current,
    /// Largest duty of a leg that switches; the remainder is the low-side on-time in which the sample falls.
    pub duty_max: I1F31,
    /// What is left to the whole period.
    pub rest: I1F31,
}

/// The whole period.
pub const WHOLE: I1F31 = I1F31::MAX;

traced! {
    /// The loop's state.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// The previous period's duty, 0 to [`WHOLE`]. Beyond `duty_max` it is a mean.
        pub duty: I1F31,
        /// The leg stays at the supply.
        pub stays_high: bool,
        /// What has been made too little of the duty beyond `duty_max`.
        pub owed: I1F31,
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
    pub fn for_bridge(&self, config: &Config) -> Duty {
        if self.stays_high {
            return Duty::MAX;
        }
        Duty::from_bits(self.duty.min(config.duty_max).max(I1F31::ZERO).to_bits() as u32)
    }

    /// Returns the duty beyond the largest of a leg that switches.
    pub fn beyond(&self, config: &Config) -> I1F31 {
        self.duty.max(config.duty_max) - config.duty_max
    }

    /// Chooses for the next two periods or more: where the duty is beyond that of a leg that switches, the leg stays high
    /// as often as makes it in the mean. A sample between two periods of one kind is of use.
    pub fn choose(&mut self, config: &Config) {
        let owed = self.owed.saturating_add(self.beyond(config));
        self.stays_high = owed >= config.rest;
        self.owed = if self.stays_high {
            owed - config.rest
        } else {
            owed
        };
    }
}

/// Returns the range that keeps the current `i` within its bounds: the more headroom the current has, the faster
/// the duty may change; beyond a bound it turns back.
///
/// With `min` = `max` the range is a single value: a current regulator. A lead of three times the current's deviation
/// from its smoothed value looks some 25 periods ahead, which damps motors whose current responds slowly. For the bound
/// on the current's own side, the lead towards zero is limited: where the inductance is low, a commutation takes half
/// of the current within a period. The current recovers by itself, and a duty that moved against the loss would drive
/// it far beyond that bound. Towards the other bound all of the lead counts, as the current may be on its way there.
///
/// The duty is at most `most`.
pub fn range(config: &Config, state: &mut State, i: Current, bounds: Bounds, most: I1F31) -> Range {
    let deviation = i.minus(state.smoothed);
    state.smoothed = state.smoothed.plus(deviation >> 3);
    let forgotten = state.peak >> PEAK_SHIFT;
    state.peak = state.peak.minus(forgotten).max(i.saturating_abs());
    let lead = deviation.saturating_mul_int(3);
    let is_negative = i.is_negative();
    let (for_least, for_greatest) = if is_negative {
        (lead.min(config.lead_to_zero_max), lead)
    } else {
        (lead, lead.max(-config.lead_to_zero_max))
    };
    let limit = |bound: Current, lead: Current| {
        let step = config.k_b.held(bound.minus(i).minus(lead));
        let duty = state.duty.plus(step);
        duty.max(I1F31::ZERO).min(most)
    };
    let mut least = limit(bounds.min, for_least);
    let mut greatest = limit(bounds.max, for_greatest);
    // Where they cross, the one on the current's side counts.
    if is_negative {
        greatest = greatest.max(least);
    } else {
        least = least.min(greatest);
    }
    Range { least, greatest }
}

/// Moves to this share of the supply as far as the range permits.
pub fn share(config: &Config, state: &mut State, share: I1F31, range: Range) {
    state.duty = share.min(range.greatest).max(range.least);
    state.stays_high &= state.duty > config.duty_max;
}

/// Regulates the speed: returns the wanted duty. `error` is wanted minus actual speed, and `before` the duty that was wanted
/// before. The integral holds while the range has kept the duty from that and the error pushes further.
pub fn speed(config: &Config, state: &mut State, (error, before): (Speed, I1F31)) -> I1F31 {
    let held_below = state.duty < before && error > Speed::ZERO;
    let held_above = state.duty > before && error < Speed::ZERO;
    let wanted = state.sigma.plus(config.k_p.held(error));
    if !(held_below || held_above) {
        let sigma = state.sigma.plus(config.k_i.held(error));
        state.sigma = sigma.max(I1F31::ZERO).min(WHOLE);
    }
    wanted
}

/// Starts speed regulation bumplessly from the present duty.
pub fn take_over(state: &mut State) {
    state.sigma = state.duty;
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT_A: f64 = 20.0;

    /// Largest duty of a leg that switches.
    const MOST: I1F31 = I1F31::lit("0.92");

    /// Gains for a bound of 20 A at 40 kHz and a full speed of 0.03 turns per period.
    fn config() -> Config {
        Config {
            k_p: Gain::new(1.0 / 0.03).expect("in range"),
            k_i: Gain::new(5e-4 / 0.03).expect("in range"),
            k_b: Gain::new(0.008).expect("in range"),
            lead_to_zero_max: amperes(LIMIT_A / 4.0),
            duty_max: MOST,
            rest: WHOLE - MOST,
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
        fn period_at_share(
            &mut self,
            config: &Config,
            state: &mut State,
            wanted: I1F31,
            bounds: Bounds,
        ) {
            let range = range(config, state, amperes(self.i_a), bounds, MOST);
            share(config, state, wanted, range);
            self.period(state.duty);
        }
    }

    /// R and L of two phases, and the supply's voltage: the bench; a racing motor with a tenth of its resistance; a
    /// gimbal motor.
    const MOTORS: [(f64, f64, f64); 3] = [
        (0.216, 61.2e-6, 24.0),
        (0.03, 20e-6, 25.0),
        (4.0, 2e-3, 25.0),
    ];

    #[test]
    fn full_share_from_rest_stays_below_1_2_times_the_limit_for_motors_of_any_kind() {
        // The last one's supply drives the limit within a sixth of a period: its current swings about the limit.
        for (r_ohm, l_h, supply_v) in MOTORS.into_iter().chain([(0.02, 5e-6, 25.0)]) {
            let (config, mut state) = (config(), State::default());
            let mut winding = Winding {
                supply_v,
                r_ohm,
                l_h,
                emf_v: 0.0,
                i_a: 0.0,
                applied: 0.0,
            };
            let (mut most, mut sum) = (0.0_f64, 0.0);
            for period in 0..4000 {
                let bounds = bounds(-5.0, LIMIT_A);
                winding.period_at_share(&config, &mut state, config.duty_max, bounds);
                most = most.max(winding.i_a);
                if period >= 3000 {
                    sum += winding.i_a;
                }
            }
            assert!(most < 1.2 * LIMIT_A, "{r_ohm}: {most}");
            let (mean, expected) = (sum / 1000.0, LIMIT_A.min(0.92 * supply_v / r_ohm));
            assert!((mean - expected).abs() < 0.2, "{r_ohm}: {mean}");
        }
    }

    #[test]
    fn a_current_halved_by_a_commutation_overshoots_by_less_than_a_fifth_of_the_limit() {
        // Driving, and braking as hard.
        for (emf_v, applied, wanted, bound_a) in
            [(6.0, 0.125, 0.92, LIMIT_A), (40.0, 0.83, 0.0, -LIMIT_A)]
        {
            let (config, mut state) = (config(), State::default());
            // Two phases of 29 mΩ and 7.6 µH at 48 V.
            let mut winding = Winding {
                supply_v: 48.0,
                r_ohm: 0.058,
                l_h: 15.2e-6,
                emf_v,
                i_a: 0.0,
                applied,
            };
            state.duty = I1F31::from_num(applied);
            let mut most = 0.0_f64;
            for period in 0..4000 {
                if period % 400 == 0 {
                    winding.i_a /= 2.0;
                }
                let bounds = bounds(-LIMIT_A, LIMIT_A);
                winding.period_at_share(&config, &mut state, I1F31::from_num(wanted), bounds);
                most = most.max(winding.i_a * bound_a.signum());
            }
            // As much as an unknown motor's may; an unlimited lead gives 1.4.
            assert!(most < 1.2 * LIMIT_A, "{bound_a}: {most}");
        }
    }

    #[test]
    fn the_range_is_in_order_and_a_single_value_for_a_single_current() {
        for (min_a, max_a) in [(-5.0, LIMIT_A), (18.0, 18.0), (0.0, 0.0), (-5.0, -5.0)] {
            for (before_a, now_a) in [(0.0, 20.0), (20.0, 0.0), (-20.0, 20.0), (20.0, -20.0)] {
                for duty in [0.0, 0.5, 0.92] {
                    let mut state = State {
                        duty: I1F31::from_num(duty),
                        smoothed: amperes(before_a),
                        ..State::default()
                    };
                    let bounds = bounds(min_a, max_a);
                    let range = range(&config(), &mut state, amperes(now_a), bounds, MOST);
                    let what = (min_a, before_a, now_a, duty);
                    assert!(range.least <= range.greatest, "{what:?}");
                    assert!(range.least == range.greatest || min_a < max_a, "{what:?}");
                }
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
                let range = range(&config, &mut state, amperes(winding.i_a), bounds, MOST);
                share(&config, &mut state, range.greatest, range);
                winding.period(state.duty);
            }
            assert!((winding.i_a - wanted_a).abs() < 0.05, "{}", winding.i_a);
        }
    }

    #[test]
    fn braking_is_bounded_when_the_share_falls() {
        // From a small current, and for the first two from the limit: the gimbal motor's supply does not drive it.
        for (n, (r_ohm, l_h, supply_v)) in MOTORS.into_iter().enumerate() {
            for i_a in [0.5, LIMIT_A] {
                if n == 2 && i_a == LIMIT_A {
                    continue;
                }
                let emf_v = supply_v / 2.0;
                let applied = (emf_v + i_a * r_ohm) / supply_v;
                let (config, mut state) = (config(), State::default());
                let mut winding = Winding {
                    supply_v,
                    r_ohm,
                    l_h,
                    emf_v,
                    i_a,
                    applied,
                };
                state.duty = I1F31::from_num(applied);
                state.smoothed = amperes(i_a);
                let mut least = 0.0_f64;
                for _ in 0..4000 {
                    let bounds = bounds(-5.0, LIMIT_A);
                    winding.period_at_share(&config, &mut state, I1F31::ZERO, bounds);
                    least = least.min(winding.i_a);
                }
                assert!(least > -5.5, "{r_ohm} from {i_a}: {least}");
                let expected = (-emf_v / r_ohm).max(-5.0);
                assert!(
                    (winding.i_a - expected).abs() < 0.1,
                    "{r_ohm}: {}",
                    winding.i_a
                );
            }
        }
    }

    #[test]
    fn the_speed_settles_without_windup() {
        // The bench's shaft: 24 V give 8880 rpm, 0.0444 turns per period; 46 ms.
        let (config, mut state) = (config(), State::default());
        let (mut speed_now, mut current_a) = (0.0_f64, 0.0_f64);
        let mut most = 0.0_f64;
        let (wanted_speed, mut wanted) = (0.02, I1F31::ZERO);
        for _ in 0..40_000 {
            let range = range(
                &config,
                &mut state,
                amperes(current_a),
                bounds(-5.0, 20.0),
                MOST,
            );
            let error = Speed::from_num(wanted_speed - speed_now);
            wanted = speed(&config, &mut state, (error, wanted));
            share(&config, &mut state, wanted, range);
            let across_v = state.duty.to_num::<f64>() * 24.0 - speed_now / 0.0444 * 24.0;
            current_a = across_v / 0.216;
            speed_now += current_a * 0.216 / 24.0 * 0.0444 * 25e-6 / 0.046;
            most = most.max(speed_now);
        }
        assert!(
            (speed_now / wanted_speed - 1.0).abs() < 0.002,
            "{speed_now}"
        );
        assert!(most < 1.1 * wanted_speed, "{most}");
    }

    #[test]
    fn a_leg_stays_high_as_often_as_makes_the_duty() {
        for wanted in [0.5, 0.93, 0.96, 0.99] {
            let mut state = State {
                duty: I1F31::from_num(wanted),
                ..State::default()
            };
            let mut sum = 0.0;
            for _ in 0..1000 {
                state.choose(&config());
                sum += (state.for_bridge(&config()).to_num::<f64>()).min(1.0);
            }
            assert!((sum / 1000.0 - wanted).abs() < 2e-4, "{wanted}: {sum}");
        }
    }

    #[test]
    fn a_leg_switches_as_soon_as_the_duty_lets_it() {
        let mut state = State {
            duty: WHOLE,
            ..State::default()
        };
        state.choose(&config());
        assert!(state.stays_high);
        let range = Range {
            least: I1F31::ZERO,
            greatest: I1F31::from_num(0.91),
        };
        share(&config(), &mut state, WHOLE, range);
        assert!(!state.stays_high);
    }
}
