//! Support of the observer at low speed: a current along d, and a bound on the current along q; and at any speed
//! the bound for a winding whose own flux would hide the rotor's.
//!
//! At low speed the back-EMF is small against the unknowns: the dead time's loss around zero current, and the drop
//! across a resistance that may be stated wrongly.

use siskin_units::math::{Gain, Held};
use siskin_units::{Current, Speed};

use super::speed::Bounds;

/// The current along d, and the bound of the one along q.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// i_d* at standstill: a current along d makes no torque, but gives each phase's current a sign.
    i_d: Current,
    /// Its decrease over the speed.
    i_d_slope: Gain<Speed, Current>,
    /// Bound on i_q at standstill.
    i_q: Current,
    /// Bound on i_q over the speed, where larger.
    i_q_slope: Gain<Speed, Current>,
    /// Largest current in braking and in driving: `LIM_PHASE_A`, or what the winding's flux allows.
    most: [Current; 2],
    /// The highest speed at which this acts.
    end: Speed,
}

impl Config {
    /// Creates the support: `i_d` along d at standstill, decreasing by `i_d_slope` over the speed; along q at most
    /// `i_q`, or `i_q_slope` times the speed where that is larger. No slope is negative. The q current is at most
    /// `most` in braking and in driving, the first no larger than the second; the drive's own bound is `limit`.
    pub fn new(
        (i_d, i_d_slope): (Current, Gain<Speed, Current>),
        (i_q, i_q_slope): (Current, Gain<Speed, Current>),
        (most, limit): ([Current; 2], Current),
    ) -> Self {
        let mut config = Self {
            i_d,
            i_d_slope,
            i_q,
            i_q_slope,
            most,
            end: Speed::MAX,
        };
        config.end = config.last(limit);
        config
    }

    /// Creates one that never acts.
    pub fn none(limit: Current) -> Self {
        let i_d = (Current::ZERO, Gain::ZERO);
        Self::new(i_d, (Current::MAX, Gain::ZERO), ([limit; 2], limit))
    }

    /// Returns the highest speed at which this acts, by bisection: with rising speed i_d* only falls and the bound
    /// on i_q only rises.
    fn last(&self, limit: Current) -> Speed {
        let acts = |bits| {
            let speed = Speed::from_bits(bits);
            self.i_d_at(speed) > Current::ZERO || self.i_q_at(speed).min(self.most[0]) < limit
        };
        if !acts(0) {
            return Speed::MIN;
        }
        let mut last = 0;
        for bit in (0..31).rev() {
            if acts(last | 1 << bit) {
                last |= 1 << bit;
            }
        }
        Speed::from_bits(last)
    }

    /// Returns i_d*, and the bounds of i_q* that it and the speed leave.
    pub fn bounds(&self, full: Bounds, speed: Speed) -> (Current, Bounds) {
        if speed > self.end {
            (Current::ZERO, full)
        } else {
            self.slow(full, speed)
        }
    }

    #[cold]
    fn slow(&self, full: Bounds, speed: Speed) -> (Current, Bounds) {
        let i_d = self.i_d_at(speed);
        let [braking, driving] = self.most;
        // Both together stay below `driving` while i_d is below 0.47 of it. A root would lengthen the longest period. The
        // braking bound is no limit of the current's, and needs no such care.
        let most = self.i_q_at(speed).min(driving.minus(i_d >> 2));
        let bounds = Bounds {
            min: full.min.max(-most.min(braking)),
            max: full.max.min(most),
        };
        (i_d, bounds)
    }

    fn i_d_at(&self, speed: Speed) -> Current {
        self.i_d
            .minus(self.i_d_slope.held(speed))
            .max(Current::ZERO)
            .min(self.i_d)
    }

    fn i_q_at(&self, speed: Speed) -> Current {
        self.i_q.max(self.i_q_slope.held(speed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PHASE: Current = Current::lit("1.5");
    const FULL: Bounds = Bounds {
        min: Current::lit("-1.5"),
        max: PHASE,
    };

    fn config() -> Config {
        let gain = |k| Gain::new(k).expect("in range");
        let at_rest = Current::from_num(0.2);
        Config::new(
            (at_rest, gain(10.0)),
            (at_rest, gain(40.0)),
            ([PHASE; 2], PHASE),
        )
    }

    #[test]
    fn what_is_done_ends_with_the_speed() {
        let config = config();
        let at = |speed: f64| config.bounds(FULL, Speed::from_num(speed));
        let (i_d, bounds) = at(0.0);
        assert_eq!(i_d, Current::from_num(0.2));
        assert_eq!(bounds.max, Current::from_num(0.2));
        assert_eq!(at(-0.1), at(0.0));
        // i_d* is gone at 0.02, and the bound on i_q reaches the drive's own at 1.5/40.
        let (i_d, bounds) = at(0.03);
        assert_eq!(i_d, Current::ZERO);
        assert!(
            (bounds.max.to_num::<f64>() - 1.2).abs() < 1e-6,
            "{bounds:?}"
        );
        assert_eq!(bounds.min, -bounds.max);
        assert_eq!(at(0.0376), (Current::ZERO, FULL));
    }

    #[test]
    fn the_end_is_the_last_speed_at_which_anything_is_done() {
        let config = config();
        let nothing = (Current::ZERO, FULL);
        assert_ne!(config.slow(FULL, config.end), nothing);
        assert_eq!(config.slow(FULL, config.end + Speed::DELTA), nothing);
    }

    #[test]
    fn both_currents_together_are_within_the_phase_s() {
        for share in [0.01, 0.1, 0.3] {
            let i_d = PHASE.to_num::<f64>() * share;
            let wide = (Current::MAX, Gain::ZERO);
            let config = Config::new(
                (Current::from_num(i_d), Gain::ZERO),
                wide,
                ([PHASE; 2], PHASE),
            );
            let (_, bounds) = config.bounds(FULL, Speed::ZERO);
            let together = bounds.max.to_num::<f64>().hypot(i_d) / PHASE.to_num::<f64>();
            assert!((0.965..1.0).contains(&together), "{share}: {together}");
        }
    }

    #[test]
    fn a_bound_below_the_drive_s_own_holds_at_any_speed() {
        let none = (Current::ZERO, Gain::ZERO);
        let [braking, driving] = [Current::lit("0.7"), Current::lit("1.05")];
        let wide = (Current::MAX, Gain::ZERO);
        let config = Config::new(none, wide, ([braking, driving], PHASE));
        for speed in [Speed::MIN, Speed::ZERO, Speed::MAX] {
            let (_, bounds) = config.bounds(FULL, speed);
            assert_eq!((bounds.min, bounds.max), (-braking, driving));
        }
    }

    #[test]
    fn none_is_nothing_at_any_speed() {
        let none = Config::none(PHASE);
        for speed in [Speed::MIN, Speed::ZERO, Speed::MAX] {
            assert_eq!(none.bounds(FULL, speed), (Current::ZERO, FULL));
        }
    }
}
