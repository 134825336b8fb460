//! Torque mode: the command is i_q, within the bounds, braking included.
//!
//! Voltage mode and tests go through it too. i_q* takes a few milliseconds across its range: at speed the current
//! loop overshoots a step by half, and a 40 A step would end in the over-current trip.

use siskin_units::math::Held;
use siskin_units::{Current, traced};

use super::regulator::Reference;
use super::speed::Bounds;

/// Limits of the change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Largest change of i_q* per outer-loop period.
    pub slew: Current,
    /// Largest growth of a driving i_q* in that time, at most the slew. With L stated wrongly the rotor seems to turn
    /// by asin(ΔL·i_q/φ), and the observer needs time to follow.
    pub growth: Current,
}

traced! {
    /// The state: i_q* of the previous period.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// i_q*.
        pub i_q: Current,
    }
}

/// Returns `reference` with its i_q* clamped to the bounds and slew-limited.
pub fn follow(
    config: &Config,
    state: &mut State,
    reference: Reference,
    bounds: Bounds,
) -> Reference {
    // From braking it may cross zero by up to the slew.
    let rise = if state.i_q < Current::ZERO {
        config.slew
    } else {
        config.growth
    };
    let i_q = bounds
        .hold(reference.i.q)
        .min(state.i_q.plus(rise))
        .max(state.i_q.minus(config.slew));
    state.i_q = i_q;
    reference.with_i_q(i_q)
}

/// Returns `reference` with the growth of its i_q* limited, for the speed regulator; it may fall at once.
pub fn grow(config: &Config, state: &mut State, reference: Reference) -> Reference {
    let least = state.i_q.min(Current::ZERO).minus(config.slew);
    let most = state.i_q.max(Current::ZERO).plus(config.growth);
    state.i_q = reference.i.q.min(most).max(least);
    reference.with_i_q(state.i_q)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: Config = Config {
        slew: Current::lit("0.01"),
        growth: Current::lit("0.005"),
    };

    fn bounds(min: f64, max: f64) -> Bounds {
        Bounds {
            min: Current::from_num(min),
            max: Current::from_num(max),
        }
    }

    fn at(i_q: f64) -> State {
        State {
            i_q: Current::from_num(i_q),
        }
    }

    #[test]
    fn what_is_commanded_moves_by_the_slew_and_stays_within_the_bounds() {
        for (asked, end, periods) in [(0.2, 0.1, 20), (-0.2, -0.05, 5), (0.03, 0.03, 6)] {
            let mut state = State::default();
            let asked = Reference::steady(Current::from_num(asked));
            let mut moved = 0;
            for _ in 0..50 {
                let before = state.i_q;
                let wanted = follow(&CONFIG, &mut state, asked, bounds(-0.05, 0.1));
                assert_eq!(wanted.i.q, state.i_q);
                assert!((state.i_q - before).abs() <= CONFIG.slew);
                moved += u32::from(state.i_q != before);
            }
            assert!(
                (state.i_q.to_num::<f64>() - end).abs() < 1e-6,
                "{}",
                state.i_q
            );
            // Plus one for the rounding of the decimal fractions.
            assert!((periods..=periods + 1).contains(&moved), "{moved}");
        }
    }

    /// Zero is crossed by the slew; from there on it is driving, and grows.
    #[test]
    fn braking_ends_by_the_slew_and_driving_grows() {
        let mut state = at(-0.025);
        let asked = Reference::steady(Current::from_num(0.5));
        for wanted in [-0.015, -0.005, 0.005, 0.01, 0.015] {
            follow(&CONFIG, &mut state, asked, bounds(-1.0, 1.0));
            let i_q = state.i_q.to_num::<f64>();
            assert!((i_q - wanted).abs() < 1e-7, "{wanted}: {i_q}");
        }
    }

    /// A bound that has come down holds no faster than by the slew.
    #[test]
    fn a_braking_current_beyond_its_bound_comes_back_by_the_slew() {
        let mut state = at(-0.055);
        let asked = Reference::steady(Current::from_num(-0.5));
        for wanted in [-0.045, -0.035, -0.03, -0.03] {
            follow(&CONFIG, &mut state, asked, bounds(-0.03, 1.0));
            let i_q = state.i_q.to_num::<f64>();
            assert!((i_q - wanted).abs() < 1e-7, "{wanted}: {i_q}");
        }
    }

    #[test]
    fn a_current_may_grow_by_so_much_and_fall_at_once() {
        for (before, asked, got) in [
            (0.0, 1.0, 0.005),
            (0.0, -1.0, -0.01),
            (0.5, 1.0, 0.505),
            (0.5, 0.0, 0.0),
            (0.5, -1.0, -0.01),
            (-0.5, -1.0, -0.51),
            (-0.5, 0.002, 0.002),
        ] {
            let mut state = at(before);
            let asked = Reference::steady(Current::from_num(asked));
            let wanted = grow(&CONFIG, &mut state, asked);
            let i_q = wanted.i.q.to_num::<f64>();
            assert!((i_q - got).abs() < 1e-7, "{before}: {i_q}");
            assert_eq!(state.i_q, wanted.i.q);
        }
        let mut end = at(0.0);
        end.i_q = Current::MAX;
        let wanted = grow(&CONFIG, &mut end, Reference::steady(Current::MAX));
        assert_eq!(wanted.i.q, Current::MAX);
    }
}
