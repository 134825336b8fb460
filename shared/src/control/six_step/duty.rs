//! The outer loop: from the speed, the current or the share of the supply that is wanted to the
//! duty of the switching leg.
//!
//! Between two commutations the duty is the voltage across two phases, and with the phases kept in
//! line with the back-EMF that is the speed (first paper, section III.B): a PI on the speed gives
//! the duty itself, and the current is only bounded. Gains are relative to the greatest speed and
//! to the current's bound, not to the motor.

use fixed::types::I1F31;

use crate::control::speed::Bounds;
use crate::math::{Gain, Held};
use crate::trace::traced;
use crate::units::{Current, Duty, Speed};

/// Time constant with which the current's peak is forgotten, in periods, as a power of two: longer
/// than a sextant where its ripple is too fast to be regulated away.
const PEAK_SHIFT: u32 = 6;

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Speed to duty.
    pub k_p: Gain<Speed, I1F31>,
    /// Speed to duty in a period.
    pub k_i: Gain<Speed, I1F31>,
    /// The current's distance from its bound to the greatest change of the duty in a period.
    pub k_b: Gain<Current, I1F31>,
    /// Greatest duty: what is left is the low sides' on-time in which the sample falls.
    pub duty_max: I1F31,
}

traced! {
    /// The loop's state.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// The duty of the period before, 0 to `duty_max`.
        pub duty: I1F31,
        /// The speed regulator's integral.
        pub sigma: I1F31,
        /// The current behind a low-pass filter of eight periods.
        pub smoothed: Current,
        /// The greatest magnitude of the current, which is forgotten slowly.
        pub peak: Current,
    }
}

/// Between what the duty may be in this period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Least duty: below, the current would fall under its bound.
    pub least: I1F31,
    /// Greatest duty.
    pub greatest: I1F31,
}

impl State {
    /// By how much the current's peaks exceed its mean: a bound of the phase currents is one of their
    /// peaks. Between two commutations the back-EMF falls and rises, and with it the current.
    pub fn ripple(&self) -> Current {
        self.peak
            .minus(self.smoothed.saturating_abs())
            .max(Current::ZERO)
    }

    /// The duty for the bridge.
    pub fn for_bridge(&self) -> Duty {
        Duty::from_bits(self.duty.max(I1F31::ZERO).to_bits() as u32)
    }
}

/// The range that keeps the current `i` within its bounds: the duty changes the faster the more
/// the current has left to them, and turns back beyond.
///
/// With `min` = `max` it is one value, the regulator of the current. Three times the current's
/// difference from its smoothed value looks some 25 periods ahead, which damps motors whose
/// current answers slowly.
pub fn range(config: &Config, state: &mut State, i: Current, bounds: Bounds) -> Range {
    let change = i.minus(state.smoothed);
    state.smoothed = state.smoothed.plus(change >> 3);
    let forgotten = state.peak >> PEAK_SHIFT;
    state.peak = state.peak.minus(forgotten).max(i.saturating_abs());
    let ahead = i.plus(change.saturating_mul_int(3));
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

/// Regulates the current, with the range of equal bounds.
pub fn current(state: &mut State, range: Range) {
    state.duty = range.greatest;
}

/// Goes to this share of the supply as the range permits.
pub fn share(state: &mut State, share: I1F31, range: Range) {
    state.duty = share.min(range.greatest).max(range.least);
}

/// Regulates the speed: `error` is what is wanted less what there is. The integral stands still
/// while the duty is held by the range and the error pushes it further.
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

/// The regulation of speed begins at the duty that there is.
pub fn take_over(state: &mut State) {
    state.sigma = state.duty;
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT_A: f64 = 20.0;

    /// Gains for a bound of 20 A at 40 kHz, and a full speed of 0.03 turns a period.
    fn config() -> Config {
        Config {
            k_p: Gain::new(1.0 / 0.03).expect("in range"),
            k_i: Gain::new(5e-4 / 0.03).expect("in range"),
            k_b: Gain::new(0.008 / LIMIT_A as f32 * 20.0).expect("in range"),
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

    /// Two phases in series behind the bridge, with a period of delay.
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
    }

    #[test]
    fn full_share_from_rest_stays_below_the_trip_for_motors_of_any_kind() {
        // The bench; a racing motor of a tenth of its resistance at 25 V; a gimbal's.
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
                let range = range(
                    &config,
                    &mut state,
                    amperes(winding.i_a),
                    bounds(-5.0, 20.0),
                );
                share(&mut state, config.duty_max, range);
                winding.period(state.duty);
                most = most.max(winding.i_a);
            }
            assert!(most < 1.3 * LIMIT_A, "{r_ohm}: {most}");
            let expected = LIMIT_A.min(0.92 * 25.0 / r_ohm);
            assert!(
                (winding.i_a - expected).abs() < 0.2,
                "{r_ohm}: {}",
                winding.i_a
            );
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
            let range = range(
                &config,
                &mut state,
                amperes(winding.i_a),
                bounds(-5.0, 20.0),
            );
            share(&mut state, I1F31::ZERO, range);
            winding.period(state.duty);
            least = least.min(winding.i_a);
        }
        assert!(least > -6.0, "{least}");
        assert!((winding.i_a + 5.0).abs() < 0.1, "{}", winding.i_a);
    }

    #[test]
    fn the_speed_settles_without_windup() {
        // The bench's shaft: 24 V are 8880 rpm, 0.0444 turns a period; 46 ms.
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
