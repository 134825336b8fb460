//! Open-loop start of the second paper, section 3.2: Park aligns the rotor, Ramp turns it.
//!
//! The current is held on the q axis of the control's frame, which turns without knowledge of the
//! rotor; the rotor follows like a stepper motor's. The observer runs all the while, so at the
//! hand-over it knows the rotor's actual position.

use fixed::types::extra::U28;
use siskin_units::dimension::TurnPerPeriod;
use siskin_units::math::{Gain, Held, Quantity, TopProduct};
use siskin_units::{
    Angle, Charge, Current, CurrentRate, InverseFlux, QUARTER_TURN, Speed, Voltage, traced,
};

use super::transform::Dq;

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// I_qr, the current of Park and Ramp.
    pub current: Current,
    /// Current times periods after which Park ends (A·s of section 3.2.2).
    pub park_charge: Charge,
    /// From current to the frame's speed in the first half of Park, which sweeps the current vector
    /// by a quarter turn so that a rotor opposite to it does not stay there.
    pub sweep: Gain<Current, Speed>,
    /// K_s, from current to the frame's acceleration per period: ω_s = K_s·∫I_qr dt (3.2.3).
    pub k_s: Gain<Current, Speed>,
    /// From speed to angle: how far the frame yields to a swinging rotor.
    pub yielding: Gain<Speed, Angle>,
    /// Share of that angle applied per period, from angle to speed.
    pub yield_rate: Gain<Angle, Speed>,
    /// Periods in which the rotor turned too slowly, minus those in which it did not, after which
    /// it has lost the frame.
    pub astray_periods: u32,
    /// R.
    pub resistance: Gain<Current, Voltage>,
    /// L, for speed times current.
    pub reactance: Gain<CurrentRate, Voltage>,
    /// ω_cl, the speed at which Run begins.
    pub run_speed: Speed,
    /// ξ of the stated flux.
    pub xi_nominal: InverseFlux,
}

traced! {
    /// The state of Park and Ramp.
    #[derive(Clone, Debug, PartialEq)]
    pub struct State {
        /// The frame's angle at the next sample. In the first frame, a quarter turn back, a current
        /// along q lies along phase a.
        pub frame: Angle,
        /// ∫I_qr in Park, in periods.
        pub charge: Charge,
        /// ω_s, the speed of the frame without its yielding.
        pub omega_s: Speed,
        /// Its change per period.
        pub acceleration: Speed,
        /// Angle by which the frame yields to the rotor's swing.
        pub yield_angle: Angle,
        /// Its change per period.
        pub yield_speed: Speed,
        /// Periods in which the rotor turned too slowly, minus those in which it did not.
        pub astray: u32,
    }
}

impl State {
    /// Creates the state of a frame that turns at `omega_s` with a rotor at `theta`, at the next sample: no Park is
    /// needed.
    pub fn aligned_to(theta: Angle, omega_s: Speed) -> Self {
        Self {
            frame: theta.wrapping_sub(QUARTER_TURN),
            charge: Charge::MAX,
            omega_s,
            ..Self::default()
        }
    }
}

impl Default for State {
    fn default() -> Self {
        Self {
            frame: -QUARTER_TURN,
            charge: Charge::ZERO,
            omega_s: Speed::ZERO,
            acceleration: Speed::ZERO,
            yield_angle: Angle::ZERO,
            yield_speed: Speed::ZERO,
            astray: 0,
        }
    }
}

/// Returns true once the rotor has had its time in Park.
pub fn aligned(config: &Config, state: &State) -> bool {
    state.charge >= config.park_charge
}

/// Runs `periods` of Park with this current: sets the frame's speed. Returns true, and does nothing, if the rotor has
/// already had its time.
pub fn park(config: &Config, state: &mut State, current: Current, periods: u32) -> bool {
    if aligned(config, state) {
        return true;
    }
    state.charge += current.over_periods(periods);
    let sweeping = state.charge < config.park_charge >> 1;
    state.omega_s = if sweeping {
        config.sweep.apply(current)
    } else {
        Speed::ZERO
    };
    false
}

/// Runs Ramp with this current: sets the frame's acceleration.
pub fn ramp(config: &Config, state: &mut State, current: Current) {
    state.acceleration = config.k_s.apply(current);
}

/// Advances the frame by one period and returns its speed.
pub fn advance(state: &mut State) -> Speed {
    state.omega_s = state.omega_s.plus(state.acceleration);
    let omega = state.omega_s.plus(state.yield_speed);
    state.frame = state.frame.wrapping_add(omega.over_period());
    omega
}

/// Damps the rotor's swing about the current vector, a pendulum that constant current does not
/// damp. The frame yields by an angle proportional to the rotor's speed relative to the frame,
/// which is ξ·h_d, since the rotor's flux is near the q axis; along d neither a wrong R nor the
/// dead time disturbs the back-EMF h_d = R·i_d − ω·L·i_q − u_d (5).
///
/// Called every `periods` periods, which are few compared with a swing.
pub fn damp(config: &Config, state: &mut State, (i, u): (Dq<Current>, Dq<Voltage>), periods: u32) {
    state.yield_angle = state
        .yield_angle
        .plus((state.yield_speed * periods as i32).over_period());
    let omega_s = state.omega_s;
    let omega = omega_s.plus(state.yield_speed);
    let h_d = config
        .resistance
        .held(i.d)
        .minus(config.reactance.held(omega.top(i.q)))
        .minus(u.d);
    // ξ·h_d has 28 fraction bits, a speed 32.
    let rotor_speed = config
        .xi_nominal
        .top(h_d)
        .max(-SPEED_END)
        .min(SPEED_END - Quantity::DELTA)
        .scaled();
    // On average a rotor that follows turns as fast as the frame. Below a quarter of the speed at
    // which Run begins, its swing is as fast.
    if omega_s > config.run_speed / 4 {
        state.astray = if rotor_speed < omega_s / 2 {
            state.astray + periods
        } else {
            state.astray.saturating_sub(periods)
        };
    }
    let target = config
        .yielding
        .held(omega_s.minus(rotor_speed))
        .min(YIELD_ANGLE_MAX)
        .max(-YIELD_ANGLE_MAX);
    state.yield_speed = config.yield_rate.apply(target.minus(state.yield_angle));
}

/// Returns true if the rotor has lost the frame of Ramp.
pub fn has_lost_rotor(config: &Config, state: &State) -> bool {
    state.astray > config.astray_periods
}

/// The maximum speed, half a turn per period, with 28 fraction bits.
const SPEED_END: Quantity<TurnPerPeriod, U28> = Quantity::from_bits(1 << 27);

/// The most that the frame yields: a sixteenth of a turn.
const YIELD_ANGLE_MAX: Angle = Angle::from_bits(1 << 28);

#[cfg(test)]
mod tests {
    use siskin_units::math::sin_cos;

    use super::*;
    use crate::control::transform::inverse_park;

    fn config() -> Config {
        Config {
            current: Current::from_num(0.5),
            park_charge: Charge::from_num(100),
            // A quarter turn in half of the charge.
            sweep: Gain::new(0.25 / 50.0).expect("in range"),
            k_s: Gain::new(1e-4).expect("in range"),
            yielding: Gain::new(200.0).expect("in range"),
            yield_rate: Gain::new(0.02).expect("in range"),
            astray_periods: 100,
            resistance: Gain::new(0.5).expect("in range"),
            reactance: Gain::new(2.0).expect("in range"),
            run_speed: Speed::from_num(0.01),
            xi_nominal: InverseFlux::from_num(0.25),
        }
    }

    #[test]
    fn park_ends_by_charge_after_a_quarter_of_a_turn() {
        let config = config();
        let mut state = State::default();
        let mut turned = 0.0;
        let mut periods = 0;
        loop {
            park(&config, &mut state, config.current, 1);
            turned += state.omega_s.to_num::<f64>();
            periods += 1;
            if aligned(&config, &state) {
                break;
            }
        }
        assert_eq!(periods, 200);
        assert!((turned - 0.25).abs() < 0.005, "{turned}");
    }

    #[test]
    fn ramp_is_the_integral_of_the_current() {
        let config = config();
        let mut state = State::default();
        ramp(&config, &mut state, config.current);
        let periods = (1..)
            .find(|_| {
                advance(&mut state);
                state.omega_s >= config.run_speed
            })
            .expect("it ends");
        // 0.01 / (0.5 · 1e-4), plus one for the rounding of K_s.
        assert!((200..=201).contains(&periods), "{periods}");
    }

    #[test]
    fn the_frame_yields_to_a_swing_by_at_most_a_sixteenth_of_a_turn() {
        let config = config();
        let mut state = State::default();
        let mut settle = |h_d: f64, omega_s: f64| {
            // h_d = R·i_d − ω·L·i_q − u_d with R = 0.5 and L = 2.
            let i = Dq {
                d: Current::from_num(0.1),
                q: Current::from_num(0.2),
            };
            let u = Dq {
                d: Voltage::from_num(0.05 - 0.4 * omega_s - h_d),
                q: Voltage::ZERO,
            };
            state.omega_s = Speed::from_num(omega_s);
            for _ in 0..1000 {
                damp(&config, &mut state, (i, u), 2);
            }
            state.yield_angle.to_num::<f64>()
        };
        // Rotor at ξ·h_d = 0.00025 turns per period: 200 times that against the swing.
        assert!((settle(0.001, 0.0) + 0.05).abs() < 1e-3);
        assert!((settle(-0.001, 0.0) - 0.05).abs() < 1e-3);
        assert!(settle(0.001, 0.00025).abs() < 1e-3);
        assert!((settle(1.0, 0.0) + 0.0625).abs() < 1e-3);
        assert!((settle(-1.0, 0.0) - 0.0625).abs() < 1e-3);
    }

    #[test]
    fn a_frame_that_yields_is_no_swing_of_the_rotor() {
        let config = config();
        let (omega_s, yielding) = (0.001, 0.0005);
        let mut state = State {
            omega_s: Speed::from_num(omega_s),
            yield_speed: Speed::from_num(yielding),
            ..State::default()
        };
        // The rotor turns as fast as the current's vector without its yielding. R·i_d is none.
        let i = Dq {
            d: Current::ZERO,
            q: Current::from_num(0.5),
        };
        let u = Dq {
            d: Voltage::from_num(-2.0 * 0.5 * (omega_s + yielding) - 4.0 * omega_s),
            q: Voltage::ZERO,
        };
        damp(&config, &mut state, (i, u), 2);
        // Back by a fiftieth of what it has yielded in the two periods.
        let back = 0.02 * 2.0 * yielding;
        let error = state.yield_speed.to_num::<f64>() + back;
        assert!(error.abs() < 1e-7, "{state:?}");
    }

    #[test]
    fn the_first_current_is_along_phase_a() {
        let along_q = Dq {
            d: Voltage::ZERO,
            q: Voltage::ONE,
        };
        let frame = sin_cos(State::default().frame);
        let stator = inverse_park(along_q, frame);
        // The table of sines is up to 8e-5 short.
        assert!(
            (stator.alpha.to_num::<f64>() - 1.0).abs() < 9e-5,
            "{stator:?}"
        );
        assert!(stator.beta.to_num::<f64>().abs() < 9e-5, "{stator:?}");
    }

    #[test]
    fn a_rotor_that_does_not_turn_with_the_frame_is_lost_and_one_that_does_is_not() {
        let config = config();
        // Above a quarter of the speed at which Run begins.
        let omega_s = Speed::from_num(0.005);
        let periods_to_loss = |followed: f64, omega_s: Speed| {
            let mut state = State {
                omega_s,
                ..State::default()
            };
            // ξ·h_d with h_d = −u_d is the rotor's speed.
            let u_d = -4.0 * followed * omega_s.to_num::<f64>();
            let u = Dq {
                d: Voltage::from_num(u_d),
                q: Voltage::ZERO,
            };
            (1..1000).find(|_| {
                damp(&config, &mut state, (Dq::default(), u), 1);
                has_lost_rotor(&config, &state)
            })
        };
        assert_eq!(
            periods_to_loss(0.0, omega_s),
            Some(config.astray_periods + 1)
        );
        assert_eq!(
            periods_to_loss(0.4, omega_s),
            Some(config.astray_periods + 1)
        );
        assert_eq!(periods_to_loss(0.6, omega_s), None);
        assert_eq!(periods_to_loss(1.0, omega_s), None);
        // Its swing is as fast.
        assert_eq!(periods_to_loss(0.0, config.run_speed / 4), None);
    }
}
