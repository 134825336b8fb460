//! Flux weakening: a current along −d where the supply's voltage is used up, so that the speed rises beyond.
//!
//! The missing voltage is integrated to i_d, as in Kim and Sul, "Speed control of interior permanent magnet
//! synchronous motor drive for the flux weakening operation", IEEE Trans. Ind. Appl. 33 (1997). While voltage is
//! missing i_d falls, with voltage to spare it returns to zero: below the speed where the supply binds there is none.

use siskin_units::math::{Held, Multiplier, other_leg};
use siskin_units::{Current, Speed, Voltage, WideVoltage, stated_emf, traced, wide};

use super::modulator::VectorLimit;
use super::speed::Bounds;
use super::transform::Dq;

/// Periods between steps.
pub const PERIODS: u32 = 16;

/// The voltage along q that is kept in reserve, so that the current stays regulated: 2^-this of the longest vector. With
/// overmodulation it makes 2 % of the fundamental.
const MARGIN: u32 = 5;

/// Coefficients.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Greatest current along −d; zero if the flux is not weakened.
    pub most: Current,
    /// From the missing voltage, a sum over the periods of a step, to the change of i_d.
    pub rate: Multiplier<WideVoltage, Current>,
    /// Speed from which there is no weakening: its back-EMF, rectified by the body diodes of a bridge that is off,
    /// is the greatest supply.
    pub end: Speed,
}

traced! {
    /// The integrator, and its input.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// i_d, zero or negative.
        pub i_d: Current,
        /// Mean voltage along q that the periods since the last step lacked, or had to spare if negative.
        pub missing: WideVoltage,
    }
}

impl State {
    /// Notes a period's voltage, and what the limit has cut off it. Periods whose voltage is far from the limit need not
    /// be noted.
    pub fn note(&mut self, u: Dq<Voltage>, cut: Option<Dq<WideVoltage>>, longest: &VectorLimit) {
        self.missing = self.missing.plus(missing(u, cut, longest));
    }
}

impl Config {
    /// Advances i_d at this speed.
    #[inline(always)] // two comparisons, in the longest period
    pub fn step(&self, state: &mut State, speed: Speed, longest: &VectorLimit) {
        if state.missing != WideVoltage::ZERO || state.i_d != Current::ZERO {
            self.weaken(state, speed, longest);
        }
    }

    #[cold]
    fn weaken(&self, state: &mut State, speed: Speed, longest: &VectorLimit) {
        if state.missing == WideVoltage::ZERO {
            // All of them were far from the limit, as after a throttle cut: there i_d only returns power to the supply.
            state.i_d = state.i_d / 2;
            return;
        }
        let mut change = self.rate.of(core::mem::take(&mut state.missing));
        if !is_fast(speed, longest) {
            change = change.min(Current::ZERO);
        }
        // Near the end there is less and less: a unit of current for each 1/128 turn a period.
        let left = self.end.minus(speed).to_bits().saturating_mul(1 << 3);
        let most = Current::from_bits(left).min(self.most).max(Current::ZERO);
        state.i_d = state.i_d.minus(change).max(-most).min(Current::ZERO);
    }

    /// Returns true if i_d will make up for missing voltage, so that nothing else needs to.
    pub fn helps(&self, state: &State, speed: Speed, longest: &VectorLimit) -> bool {
        state.i_d > -self.most && speed < self.end && is_fast(speed, longest)
    }

    /// Returns the bounds of i_q beside i_d, so that both together stay within `limit`.
    #[inline(always)] // a comparison, in the longest period
    pub fn bounds(&self, state: &State, bounds: Bounds, limit: Current) -> Bounds {
        if state.i_d == Current::ZERO {
            bounds
        } else {
            beside(state.i_d, bounds, limit)
        }
    }
}

/// Returns true if the back-EMF takes much of the voltage; below, it is the current's change.
fn is_fast(speed: Speed, longest: &VectorLimit) -> bool {
    stated_emf(speed) > longest.length() >> 1
}

/// Returns the voltage along q that is missing, or negative to spare.
#[inline(never)] // few periods
fn missing(u: Dq<Voltage>, cut: Option<Dq<WideVoltage>>, longest: &VectorLimit) -> WideVoltage {
    let cut = cut.map_or(WideVoltage::ZERO, |cut| cut.q);
    let spare = longest.q_max_beside(u.d).minus(wide(u.q));
    cut.plus(wide(longest.length() >> MARGIN)).minus(spare)
}

#[cold]
fn beside(i_d: Current, bounds: Bounds, limit: Current) -> Bounds {
    let most = other_leg(limit, i_d);
    Bounds {
        min: bounds.min.max(-most),
        max: bounds.max.min(most),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOST: Current = Current::lit("0.8");

    const RESERVE: f64 = 1.0 / (1 << MARGIN) as f64;

    fn config() -> Config {
        Config {
            most: MOST,
            rate: Multiplier::new(0.01 / PERIODS as f32).expect("in range"),
            end: Speed::from_num(0.2),
        }
    }

    /// The longest vector is 0.5, so half of it is the back-EMF at 0.0625 turns a period.
    fn longest() -> VectorLimit {
        VectorLimit::new(Voltage::from_num(0.5), Voltage::ZERO)
    }

    fn u(q: f64) -> Dq<Voltage> {
        Dq {
            d: Voltage::ZERO,
            q: Voltage::from_num(q),
        }
    }

    /// Runs steps at this speed with a demand along q, as the current loop does near the limit.
    fn run(config: &Config, state: &mut State, speed: f64, demand: f64, steps: u32) {
        let speed = Speed::from_num(speed);
        for _ in 0..steps {
            let applied = demand.min(0.5);
            let cut = (demand > applied).then(|| Dq {
                d: WideVoltage::ZERO,
                q: WideVoltage::from_num(demand - applied),
            });
            if demand > 0.3 {
                for _ in 0..PERIODS {
                    state.note(u(applied), cut, &longest());
                }
            }
            config.step(state, speed, &longest());
        }
    }

    #[test]
    fn missing_voltage_is_integrated_up_to_the_most_and_returns_with_voltage_to_spare() {
        let (config, mut state) = (config(), State::default());
        run(&config, &mut state, 0.1, 0.6, 1);
        // 0.1 V beyond the limit and the reserve, at 0.01 a volt.
        let i_d = state.i_d.to_num::<f64>();
        assert!((i_d + 0.01 * (0.1 + 0.5 * RESERVE)).abs() < 1e-5, "{i_d}");
        run(&config, &mut state, 0.1, 0.6, 1000);
        assert_eq!(state.i_d, -MOST);
        run(&config, &mut state, 0.1, 0.2, 1000);
        assert_eq!(state, State::default());
    }

    #[test]
    fn at_the_reserve_it_rests() {
        let (config, mut state) = (config(), State::default());
        run(&config, &mut state, 0.1, 0.6, 100);
        let before = state.i_d;
        run(&config, &mut state, 0.1, 0.5 * (1.0 - RESERVE), 100);
        let moved = (state.i_d - before).to_num::<f64>();
        // 100 roundings of the voltage's 2^-24.
        assert!(moved.abs() < 1e-5, "{moved}");
    }

    #[test]
    fn a_slow_rotor_keeps_its_flux() {
        let (config, mut state) = (config(), State::default());
        run(&config, &mut state, 0.06, 0.6, 100);
        assert_eq!(state.i_d, Current::ZERO);
        assert!(!config.helps(&state, Speed::from_num(0.06), &longest()));
        assert!(config.helps(&state, Speed::from_num(0.07), &longest()));
    }

    #[test]
    fn it_fades_towards_the_speed_that_endangers_the_supply() {
        for (speed, most) in [(0.19, 0.8), (0.1975, 0.32), (0.2, 0.0), (0.25, 0.0)] {
            let (config, mut state) = (config(), State::default());
            run(&config, &mut state, speed, 0.6, 2000);
            let i_d = state.i_d.to_num::<f64>();
            assert!((i_d + most).abs() < 1e-4, "{speed}: {i_d}");
        }
    }

    #[test]
    fn both_currents_together_are_within_the_limit() {
        let config = config();
        let full = Bounds {
            min: -Current::ONE,
            max: Current::ONE,
        };
        let mut state = State::default();
        assert_eq!(config.bounds(&state, full, Current::ONE), full);
        state.i_d = Current::from_num(-0.6);
        let bounds = config.bounds(&state, full, Current::ONE);
        assert!((bounds.max.to_num::<f64>() - 0.8).abs() < 1e-6);
        assert_eq!(bounds.min, -bounds.max);
    }

    #[test]
    fn none_is_none() {
        let (config, mut state) = (Config::default(), State::default());
        run(&config, &mut state, 0.1, 0.6, 100);
        assert_eq!(state.i_d, Current::ZERO);
        assert!(!config.helps(&state, Speed::from_num(0.1), &longest()));
    }
}
