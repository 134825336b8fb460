//! Open-loop start of the second paper, section 3.2: Park aligns the rotor, Ramp turns it.
//!
//! The current is held on the q axis of the control's frame, and the frame is turned without
//! knowledge of the rotor, which follows like a stepper motor's. The back-EMF observer runs in that
//! frame all the while, so at the hand-over it tells where the rotor really is.

use fixed::types::I36F28;
use fixed::types::extra::{U28, U32};

use super::transform::Dq;
use crate::math::{Gain, TopProduct, atan2_turns, magnitude};
use crate::units::{Angle, Current, InverseFlux, Speed, Voltage};

/// Coefficients for one sample period T_s.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// I_qr, the current of Park and Ramp.
    pub current: Current,
    /// Greatest current of a test of the motor.
    pub test_current: Current,
    /// Current times periods after which Park ends (A·s of section 3.2.2).
    pub park_charge: I36F28,
    /// Current to the frame's speed in the first half of Park. It turns the current's vector by a
    /// quarter of a turn, so that a rotor that stood opposite to it does not stay there.
    pub sweep: Gain<U28, U32>,
    /// K_s, current to the frame's acceleration in a period: ω_s = K_s·∫I_qr dt (3.2.3).
    pub k_s: Gain<U28, U32>,
    /// Speed to angle: how far the frame yields to a rotor that swings.
    pub yielding: Gain<U32, U32>,
    /// Share of that angle that is taken in a period, as speed to speed.
    pub yield_rate: Gain<U32, U32>,
    /// ω_cl, the speed at which Run begins.
    pub run_speed: Speed,
}

/// What Park and Ramp remember.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// ∫I_qr in Park, in periods.
    pub charge: I36F28,
    /// ω_s, the speed of the frame.
    pub omega_s: Speed,
    /// Angle by which the frame yields to the rotor's swing.
    pub yielded: Angle,
}

/// One period of Park: the frame's speed, and whether the rotor has had its time.
#[inline]
pub fn park(config: &Config, state: &mut State, current: Current) -> (Speed, bool) {
    state.charge += I36F28::from(current);
    let sweeping = state.charge < config.park_charge / 2;
    let omega = if sweeping {
        config.sweep.apply(current)
    } else {
        Speed::ZERO
    };
    (omega, state.charge >= config.park_charge)
}

/// One period of Ramp: the frame's speed, and whether it has reached ω_cl.
#[inline]
pub fn ramp(config: &Config, state: &mut State, current: Current) -> (Speed, bool) {
    state.omega_s = state.omega_s.saturating_add(config.k_s.apply(current));
    (state.omega_s, state.omega_s >= config.run_speed)
}

/// Damps the rotor's swing about the current's vector: a pendulum that a constant current does not
/// damp. The frame yields by an angle in proportion to the rotor's speed against the frame, which
/// is ξ·h_d, since the rotor's flux stands near the q axis; along d, neither a wrong R nor the dead
/// time disturbs the back-EMF.
///
/// Returns what it adds to the frame's speed in this period.
#[inline]
pub fn damp(
    config: &Config,
    state: &mut State,
    h_d: Voltage,
    omega_s: Speed,
    xi_nominal: InverseFlux,
) -> Speed {
    // ξ·h_d has 28 fraction bits, a speed 32.
    let rotor = Speed::saturating_from_num(xi_nominal.top(h_d));
    let target = config
        .yielding
        .saturating_apply(omega_s.saturating_sub(rotor))
        .min(QUARTER_TURN)
        .max(-QUARTER_TURN);
    let step = config
        .yield_rate
        .apply(target.saturating_sub(state.yielded));
    state.yielded += step;
    step
}

const QUARTER_TURN: Angle = Angle::from_bits(1 << 30);

/// Where the rotor is, as seen from the imposed frame: θ̃ = θ − θ̂ of h = χ·(sin θ̃, −cos θ̃) (5).
///
/// `None` where the back-EMF is not between half and twice of what the stated flux gives at the
/// frame's speed: the rotor has not followed, or there is none and the voltage met no current.
pub fn rotor_lead(h: Dq<Voltage>, omega_s: Speed, xi_nominal: InverseFlux) -> Option<Angle> {
    // A speed has 32 fraction bits, ξ·|h| 28.
    let expected = omega_s.to_bits() >> 4;
    let found = xi_nominal.top(magnitude(h.d, h.q)).to_bits();
    let followed = found >= expected / 2 && found <= expected.saturating_mul(2);
    followed.then(|| atan2_turns(h.d, h.q.saturating_neg()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config() -> Config {
        Config {
            current: Current::from_num(0.5),
            test_current: Current::from_num(0.1),
            park_charge: I36F28::from_num(100),
            // A quarter of a turn in half of the charge.
            sweep: Gain::new(0.25 / 50.0).expect("in range"),
            k_s: Gain::new(1e-4).expect("in range"),
            yielding: Gain::new(200.0).expect("in range"),
            yield_rate: Gain::new(0.02).expect("in range"),
            run_speed: Speed::from_num(0.01),
        }
    }

    #[test]
    fn park_ends_by_charge_after_a_quarter_of_a_turn() {
        let config = config();
        let mut state = State::default();
        let mut turned = 0.0;
        let mut periods = 0;
        loop {
            let (omega, done) = park(&config, &mut state, config.current);
            turned += omega.to_num::<f64>();
            periods += 1;
            if done {
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
        let periods = (1..)
            .find(|_| ramp(&config, &mut state, config.current).1)
            .expect("it ends");
        // 0.01 / (0.5 · 1e-4), and one for the rounding of K_s.
        assert!((200..=201).contains(&periods), "{periods}");
    }

    #[test]
    fn the_frame_yields_to_a_swing_by_at_most_a_quarter_of_a_turn() {
        let config = config();
        let mut state = State::default();
        let xi = InverseFlux::from_num(0.25);
        let mut settle = |h_d: f64, omega_s: f64| {
            for _ in 0..1000 {
                let omega_s = Speed::from_num(omega_s);
                damp(&config, &mut state, Voltage::from_num(h_d), omega_s, xi);
            }
            state.yielded.to_num::<f64>()
        };
        // Rotor at ξ·h_d = 0.0005 turns a period: 200 times that against the swing.
        assert!((settle(0.002, 0.0) + 0.1).abs() < 1e-3);
        assert!((settle(-0.002, 0.0) - 0.1).abs() < 1e-3);
        assert!(settle(0.002, 0.0005).abs() < 1e-3);
        assert!((settle(1.0, 0.0) + 0.25).abs() < 1e-3);
    }

    #[test]
    fn the_rotor_is_found_by_its_back_emf() {
        let omega = Speed::from_num(0.01);
        let xi = InverseFlux::from_num(0.25);
        // χ = ω/ξ = 0.04; the rotor leads the frame by 60°.
        let h = Dq {
            d: Voltage::from_num(0.04 * 0.866_025),
            q: Voltage::from_num(-0.04 * 0.5),
        };
        let lead = rotor_lead(h, omega, xi).expect("it has followed");
        assert!((lead.to_num::<f64>() * 360.0 - 60.0).abs() < 0.05);
        let weak = Dq {
            d: Voltage::from_num(0.015),
            q: Voltage::ZERO,
        };
        assert_eq!(rotor_lead(weak, omega, xi), None);
        let strong = Dq {
            d: Voltage::from_num(0.09),
            q: Voltage::ZERO,
        };
        assert_eq!(rotor_lead(strong, omega, xi), None);
    }
}
