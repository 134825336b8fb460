//! The speed regulators against their equations.

use proptest::prelude::*;
use siskin_params::ParamId;
use siskin_units::trace::Trace;
use siskin_units::{Current, Torque};

use super::{K_I_OMEGA, K_P_OMEGA, P, PHI, TABLE_III, TS, Units, config_with, near};
use crate::control::PERIODS;
use crate::control::observer::SlowEstimate;
use crate::control::speed::{Bounds, Input, State};

/// `CTL_SPEED`.
const FEED_FORWARD: f32 = 1.0;
const PUBLISHED: f32 = 2.0;

/// The speed regulators' period.
const T: f64 = TS * PERIODS as f64;

/// J of section V.
const J: f64 = 1.43e-4;
/// Nm per ampere, peak.
const TORQUE_CONSTANT: f64 = 1.5 * P * PHI;

fn units(speed: f32) -> Units {
    let observer_based = (ParamId::CtlRegulator, 0.0);
    Units(config_with(&[(ParamId::CtlSpeed, speed), observer_based]))
}

/// Returns the integrator's torque, Nm, or its current, A: the trace words after the planner's.
fn sigma(units: &Units, state: &State) -> [f64; 2] {
    let mut words = std::vec::Vec::new();
    state.trace(&mut |word| words.push(word as i32));
    [
        units.nm(Torque::from_bits(words[3])),
        units.amperes(Current::from_bits(words[4])),
    ]
}

/// A period, in mechanical rad/s and A.
struct Case {
    omega_m: f64,
    omega_star: f64,
    omega_dot_star: f64,
    y_f: f64,
    xi: f64,
    xi_dot: f64,
    sigma_nm: f64,
    bound: f64,
    missing: f64,
}

struct Outcome {
    i_q: f64,
    p_q: f64,
    u_q: f64,
    /// For both integrators.
    sigma_step: [f64; 2],
    /// Of ω*, mechanical rad/s².
    omega_dot_star: f64,
}

impl Case {
    fn run(&self, units: &Units) -> Outcome {
        let config = &units.0.speed;
        let mut state = State::default();
        let begin = units.speed(P * self.omega_star);
        let i_q = units.current(self.sigma_nm / TORQUE_CONSTANT);
        config.preset(&mut state, begin, i_q);
        let before = sigma(units, &state);
        let step = units.speed(P * self.omega_dot_star * T);
        let wanted = config.current(
            &mut state,
            &Input {
                command: begin + step,
                speed: units.speed(P * self.omega_m),
                slow_estimate: SlowEstimate {
                    omega_bar_step: units.speed(P * self.y_f * TS),
                    xi: units.xi(self.xi),
                    xi_step: units.xi(self.xi_dot * TS),
                    lost: false,
                },
                bounds: Bounds {
                    min: units.current(-self.bound),
                    max: units.current(self.bound),
                },
                i_q_shortfall: units.current(self.missing),
            },
        );
        let after = sigma(units, &state);
        Outcome {
            i_q: units.amperes(wanted.i.q),
            p_q: units.amperes(wanted.i_q_step) / TS,
            u_q: units.volts(wanted.u_q),
            sigma_step: [after[0] - before[0], after[1] - before[1]],
            omega_dot_star: units.rad_s(state.reference() - begin) / P / T,
        }
    }
}

proptest! {
    /// (8) and (9) away from the bounds, and the bounds.
    #[test]
    fn the_published_one_is_that_of_the_equations(
        omega_m in 100.0..600.0_f64,
        error in -60.0..60.0_f64,
        omega_dot_star in -2000.0..2000.0_f64,
        y_f in -2000.0..2000.0_f64,
        xi_factor in 0.7..1.5_f64,
        xi_dot in -1000.0..1000.0_f64,
        sigma_nm in -0.3..0.3_f64,
        bound in 2.0..20.0_f64,
    ) {
        let units = units(PUBLISHED);
        let xi = xi_factor / PHI;
        let omega_star = omega_m - error - omega_dot_star * T;
        let got = Case {
            omega_m, omega_star, omega_dot_star, y_f, xi, xi_dot, sigma_nm, bound, missing: 0.0,
        }.run(&units);
        let torque = -K_P_OMEGA * error + sigma_nm;
        let i_q = 2.0 / (3.0 * P) * xi * torque;
        let tolerance = 0.001 + TABLE_III * 2.0 / (3.0 * P) * xi * (K_P_OMEGA * error).abs();
        if i_q.abs() < bound - tolerance {
            near(got.i_q, i_q, 1e-4, tolerance)?;
            let torque_dot = -K_P_OMEGA * y_f + K_P_OMEGA * omega_dot_star - K_I_OMEGA * error;
            let p_q = 2.0 / (3.0 * P) * (xi_dot * torque + xi * torque_dot);
            near(got.p_q, p_q, TABLE_III, 30.0)?;
            let step = T * K_I_OMEGA * error;
            near(got.sigma_step[0], -step, 0.0, TABLE_III * step.abs() + 1e-6)?;
        } else {
            prop_assert!(got.i_q.abs() <= bound + 1e-4);
        }
        near(got.omega_dot_star, omega_dot_star, 0.0, 0.1)?;
    }

    /// With the torque of ω̇*, and ω* yielding to a current that is unavailable.
    #[test]
    fn the_default_adds_the_inertia_and_conditions_the_reference(
        omega_m in 100.0..600.0_f64,
        error in -10.0..10.0_f64,
        // Within the jerk: 20 000 rpm/s in 5 ms.
        omega_dot_star in -27.0..27.0_f64,
        sigma_nm in -0.3..0.3_f64,
        bound in 2.0..20.0_f64,
        missing in prop_oneof![Just(0.0), -2.0..2.0_f64],
    ) {
        let units = units(0.0);
        let omega_star = omega_m - error - omega_dot_star * T;
        let got = Case {
            omega_m, omega_star, omega_dot_star, y_f: 0.0, xi: 1.0 / PHI, xi_dot: 0.0, sigma_nm,
            bound, missing,
        }.run(&units);
        // Both poles at 0.8 of 2π·7.9 1/s.
        let pole = 0.8 * std::f64::consts::TAU * 7.9;
        let free = sigma_nm - 2.0 * pole * J * error + J * omega_dot_star;
        let i_q = free / TORQUE_CONSTANT;
        let over = i_q - i_q.clamp(-bound, bound) + missing;
        near(got.i_q, i_q.clamp(-bound, bound), 1e-4, 0.002)?;
        let possible = omega_dot_star - over * TORQUE_CONSTANT / J;
        // 20 000 rpm/s.
        let taken = possible.clamp(-2094.4, 2094.4);
        near(got.omega_dot_star, taken, 1e-3, 1.0)?;
        let step = -T * pole * pole * J * error;
        let conditioned = (possible - taken).abs() < 1.0;
        let comes_back = over.signum() != step.signum();
        if conditioned || comes_back {
            near(got.sigma_step[0], step, 1e-3, 1e-7)?;
        } else if (possible - taken).abs() > 3.0 {
            near(got.sigma_step[0], 0.0, 0.0, 1e-9)?;
        }
    }

    /// Figure 47.
    #[test]
    fn the_one_with_feed_forward_is_that_of_the_figure(
        omega_m in 100.0..600.0_f64,
        error in -60.0..60.0_f64,
        sigma_nm in -0.1..0.1_f64,
        bound in 2.0..20.0_f64,
        regulator in 0_u8..3,
    ) {
        let units = Units(config_with(&[
            (ParamId::CtlSpeed, FEED_FORWARD),
            (ParamId::CtlRegulator, f32::from(regulator)),
            (ParamId::CtlFfA, 8.0),
        ]));
        let omega_r = omega_m + error;
        let got = Case {
            omega_m, omega_star: omega_r, omega_dot_star: 0.0, y_f: 0.0, xi: 1.0 / PHI,
            xi_dot: 0.0, sigma_nm, bound, missing: 0.0,
        }.run(&units);
        // It begins with `sigma_nm` as the total current, the propeller's share included.
        let i_q = (sigma_nm + K_P_OMEGA * error) / TORQUE_CONSTANT;
        let tolerance = 0.002 + TABLE_III * (K_P_OMEGA * error / TORQUE_CONSTANT).abs();
        near(got.i_q, i_q.clamp(-bound, bound), 1e-3, tolerance)?;
        // Regulators 0 and 1 supply the back-EMF of the measured speed themselves.
        let own = if regulator == 2 { 0.0 } else { omega_m };
        near(got.u_q, P * PHI * (omega_r - own), 1e-4, 1e-4)?;
        let step = T * K_I_OMEGA * error / TORQUE_CONSTANT;
        let over = i_q.abs() - bound;
        if over < -tolerance || i_q.signum() != step.signum() {
            near(got.sigma_step[1], step, TABLE_III, 1e-6)?;
        } else if over > tolerance {
            near(got.sigma_step[1], 0.0, 0.0, 1e-9)?;
        }
    }
}

#[test]
fn the_current_of_the_propeller_goes_with_the_square_of_the_speed() {
    let units = Units(config_with(&[
        (ParamId::CtlSpeed, FEED_FORWARD),
        (ParamId::CtlFfA, 8.0),
    ]));
    let at = |rpm: f32| {
        let speed = units.0.scale.speed_from_rpm(rpm);
        let mut state = State::default();
        units.0.speed.preset(&mut state, speed, Current::ZERO);
        -sigma(&units, &state)[1]
    };
    for (rpm, i_q) in [(6000.0, 8.0), (3000.0, 2.0), (600.0, 0.08), (-3000.0, -2.0)] {
        assert!((at(rpm) - i_q).abs() < 1e-3, "{rpm}: {}", at(rpm));
    }
}

#[test]
fn at_a_bound_the_published_integrator_only_comes_back() {
    let units = units(PUBLISHED);
    let sigma_step = |error: f64, sigma_nm: f64| {
        let got = Case {
            omega_m: 300.0,
            omega_star: 300.0 - error,
            omega_dot_star: 0.0,
            y_f: 0.0,
            xi: 1.0 / PHI,
            xi_dot: 0.0,
            sigma_nm,
            bound: 1.0,
            missing: 0.0,
        }
        .run(&units);
        assert!(got.p_q.abs() < 1e-9);
        got.sigma_step[0]
    };
    // Too slow, and too much torque requested already: 1 A is 0.0234 Nm.
    assert!(sigma_step(-50.0, 0.2).abs() < 1e-9);
    // Too fast while the integrator requests far too much: it falls.
    assert!(sigma_step(1.0, 0.2) < 0.0);
    assert!(sigma_step(50.0, -0.2).abs() < 1e-9);
}

#[test]
fn at_low_speed_a_share_of_the_error_is_acted_on() {
    let default = units(0.0);
    let regulated = |units: &Units, omega: f64| {
        let got = Case {
            omega_m: omega / P,
            omega_star: (omega - 60.0) / P,
            omega_dot_star: 0.0,
            y_f: 0.0,
            xi: 1.0 / PHI,
            xi_dot: 0.0,
            sigma_nm: 0.1,
            bound: 20.0,
            missing: 0.0,
        }
        .run(units);
        [got.i_q - 0.1 / TORQUE_CONSTANT, got.sigma_step[0]]
    };
    let full = regulated(&default, 3000.0);
    assert!(full[0] < -0.1 && full[1] < -1e-6, "{full:?}");
    // In full from where the back-EMF is 1.5 times the drop of 4 A across R.
    let trusted = 1.5 * 0.108 * 4.0 / PHI;
    for (share, wanted) in [
        (0.0, 0.0),
        (0.1, 0.1),
        (0.5, 0.5),
        (0.9, 0.9),
        (1.0, 1.0),
        (2.0, 1.0),
    ] {
        let got = regulated(&default, share * trusted);
        for (got, full) in got.iter().zip(full) {
            assert!(
                (got / full - wanted).abs() < 0.01,
                "{share}: {got} of {full}"
            );
        }
    }
    let backwards = regulated(&default, -trusted);
    assert!(
        backwards.iter().all(|got| got.abs() < 1e-4),
        "{backwards:?}"
    );
    // As published, and with sensors: in full from a ten-thousandth of a turn per period.
    let sensors = Units(config_with(&[(ParamId::CtlObserver, 2.0)]));
    for (units, full) in [(units(PUBLISHED), None), (sensors, Some(full))] {
        let full = full.unwrap_or_else(|| regulated(&units, 3000.0));
        let got = regulated(&units, 12.0);
        for (got, full) in got.iter().zip(full) {
            assert!((got / full - 1.0).abs() < 0.01, "{got} of {full}");
        }
    }
}
