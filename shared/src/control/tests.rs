//! The fixed-point blocks against the papers' equations in double precision and SI units.
//!
//! Inputs are the motor's of the first paper at some thousand rpm, disturbed at random; each block
//! runs from the same state for some periods, and the difference at the end is bounded.

use proptest::prelude::*;
use std::f64::consts::TAU;

use super::delay::Delay;
use super::observer::{Estimate, back_emf};
use super::regulator::{Feedback, Reference, observer_based as regulator};
use super::speed::{self, Bounds};
use super::transform::Dq;
use crate::drive::Config;
use crate::params::{Board, ParamId, Params, build};
use crate::units::{Current, InverseFlux, Speed, Torque, Voltage};

const R: f64 = 0.108;
const L: f64 = 30.6e-6;
const PHI: f64 = 1.3e-3;
const P: f64 = 12.0;
const TS: f64 = 1.0 / 15_000.0;

/// Table III, which the defaults make up to the rounding of the paper's own figures.
const K_P: f64 = 1178.0;
const K_I: f64 = 340.0;
const K_PE: f64 = 964.0;
const K_IE: f64 = 154.6;
const K_ETA: f64 = 115.8;
const GAMMA: f64 = 6707.0;
const K_F: f64 = 500.0;
const K_P_OMEGA: f64 = 7.1e-3;
const K_I_OMEGA: f64 = 41.7e-3;

/// How far the computed gains may lie from Table III: its eigenvalues have three digits.
const TABLE_III: f64 = 0.02;

fn config() -> Config {
    let mut params = Params::default();
    params.set(ParamId::PwmFreqHz, 15_000.0).expect("in range");
    let board = Board {
        delay: Delay::None,
        ..Board::BENCH
    };
    build(&params, &board).expect("the defaults fit")
}

/// Between SI and the control's units.
struct Units(Config);

impl Units {
    fn current(&self, a: f64) -> Current {
        Current::from_num(a / f64::from(self.0.scale.current_a))
    }
    fn amperes(&self, i: Current) -> f64 {
        i.to_num::<f64>() * f64::from(self.0.scale.current_a)
    }
    fn voltage(&self, v: f64) -> Voltage {
        Voltage::from_num(v / f64::from(self.0.scale.voltage_v))
    }
    fn volts(&self, u: Voltage) -> f64 {
        u.to_num::<f64>() * f64::from(self.0.scale.voltage_v)
    }
    fn speed(&self, rad_s: f64) -> Speed {
        Speed::from_num(rad_s * TS / TAU)
    }
    fn rad_s(&self, omega: Speed) -> f64 {
        omega.to_num::<f64>() * TAU / TS
    }
    fn xi(&self, xi: f64) -> InverseFlux {
        InverseFlux::from_num(xi / f64::from(self.0.scale.inverse_flux_per_wb()))
    }
    fn per_wb(&self, xi: InverseFlux) -> f64 {
        xi.to_num::<f64>() * f64::from(self.0.scale.inverse_flux_per_wb())
    }
    fn torque(&self, nm: f64) -> Torque {
        Torque::from_num(nm / f64::from(self.0.scale.torque_nm()))
    }
    fn nm(&self, torque: Torque) -> f64 {
        torque.to_num::<f64>() * f64::from(self.0.scale.torque_nm())
    }
}

fn near(got: f64, wanted: f64, relative: f64, absolute: f64) -> Result<(), TestCaseError> {
    let bound = relative * wanted.abs() + absolute;
    prop_assert!(
        (got - wanted).abs() <= bound,
        "{got} instead of {wanted}, ± {bound}"
    );
    Ok(())
}

proptest! {
    /// (6), (7) and (28) over one period from any state around the working point.
    #[test]
    fn the_observer_is_that_of_the_equations(
        i in prop::array::uniform2(-15.0..15.0_f64),
        i_error in prop::array::uniform2(-1.0..1.0_f64),
        h_d in -1.0..1.0_f64,
        h_q in -12.0..-1.0_f64,
        u in prop::array::uniform2(-8.0..8.0_f64),
        flux_factor in 0.7..1.5_f64,
        omega_f in 500.0..7000.0_f64,
    ) {
        let units = Units(config());
        let observer = &units.0.observer;
        let i_hat = [i[0] - i_error[0], i[1] - i_error[1]];
        let xi = flux_factor / PHI;
        let mut state = back_emf::State {
            i: Dq { d: units.current(i_hat[0]), q: units.current(i_hat[1]) },
            h: Dq { d: units.voltage(h_d), q: units.voltage(h_q) },
            xi: units.xi(xi),
            omega_f: units.speed(omega_f),
            ..back_emf::State::default()
        };

        let estimate = back_emf::estimate(observer, &mut state);
        let omega_bar = xi * h_d.hypot(h_q);
        let omega = omega_bar + K_ETA * h_d;
        near(units.rad_s(estimate.omega_bar), omega_bar, 1e-5, 0.01)?;
        near(units.rad_s(estimate.omega), omega, 1e-5, 0.01 + TABLE_III * (K_ETA * h_d).abs())?;
        let y_f = -K_F * (omega_f - omega_bar);
        near(units.rad_s(estimate.omega_bar_step) / TS, y_f, TABLE_III, 10.0)?;
        near(units.rad_s(state.omega_f), omega_f + y_f * TS, 0.0, TABLE_III * (y_f * TS).abs() + 0.01)?;

        back_emf::adapt(observer, &mut state, estimate.xi_step);
        near(units.per_wb(state.xi), xi + TS * GAMMA * h_d, 0.0, 0.03 * TS * GAMMA * h_d.abs() + 0.01)?;

        let measured = Dq { d: units.current(i[0]), q: units.current(i[1]) };
        let applied = Dq { d: units.voltage(u[0]), q: units.voltage(u[1]) };
        back_emf::advance(observer, &mut state, estimate.omega, measured, applied);
        let omega = units.rad_s(estimate.omega);
        let decay = 1.0 - (-R * TS / L).exp();
        let cross = [omega * i[1], -omega * i[0]];
        let h = [h_d, h_q];
        for (axis, got) in [state.i.d, state.i.q].into_iter().enumerate() {
            let drive = (h[axis] + u[axis]) / L + cross[axis] + K_P * i_error[axis];
            let wanted = i_hat[axis] * (1.0 - decay) + decay * L / R * drive;
            near(units.amperes(got), wanted, 1e-4, 0.003)?;
        }
        for (axis, got) in [state.h.d, state.h.q].into_iter().enumerate() {
            let step = TS * K_I * i_error[axis];
            near(units.volts(got), h[axis] + step, 1e-6, TABLE_III * step.abs() + 1e-5)?;
        }
        let turned = (omega * TS / TAU + 0.5).rem_euclid(1.0) - 0.5;
        near(state.theta.to_num::<f64>(), turned, 0.0, 1e-7)?;
    }

    /// (10) and its integrators.
    #[test]
    fn the_regulator_is_that_of_the_equations(
        omega in 500.0..7500.0_f64,
        i in prop::array::uniform2(-15.0..15.0_f64),
        i_hat in prop::array::uniform2(-15.0..15.0_f64),
        h in prop::array::uniform2(-10.0..10.0_f64),
        sigma in prop::array::uniform2(-1.0..1.0_f64),
        i_q_star in -15.0..15.0_f64,
        p_q_star in -3000.0..3000.0_f64,
    ) {
        let units = Units(config());
        let wanted = Reference {
            i: Dq {
                d: Current::ZERO,
                q: units.current(i_q_star),
            },
            u_q: Voltage::ZERO,
            i_q_step: units.current(p_q_star * TS),
        };
        let feedback = Feedback {
            omega: units.speed(omega),
            i: Dq { d: units.current(i[0]), q: units.current(i[1]) },
            i_hat: Dq { d: units.current(i_hat[0]), q: units.current(i_hat[1]) },
            h_hat: Dq { d: units.voltage(h[0]), q: units.voltage(h[1]) },
        };
        let mut state = regulator::State {
            sigma: Dq { d: units.voltage(sigma[0]), q: units.voltage(sigma[1]) },
        };
        let u = regulator::voltage(&units.0.regulator, &state, wanted, &feedback);
        let e = [i_hat[0], i_hat[1] - i_q_star];
        let u_d = -h[0] - L * (omega * i[1] + K_PE * e[0]) + sigma[0];
        let u_q = R * i_q_star - h[1] + L * (omega * i[0] + p_q_star - K_PE * e[1]) + sigma[1];
        near(units.volts(u.d), u_d, 1e-5, 1e-4 + TABLE_III * L * K_PE * e[0].abs())?;
        near(units.volts(u.q), u_q, 1e-5, 1e-4 + TABLE_III * L * K_PE * e[1].abs())?;

        regulator::integrate(&units.0.regulator, &mut state, wanted, &feedback);
        for (axis, got) in [state.sigma.d, state.sigma.q].into_iter().enumerate() {
            let step = TS * K_IE * e[axis];
            near(units.volts(got), sigma[axis] - step, 1e-6, TABLE_III * step.abs() + 1e-5)?;
        }
    }

    /// (8) and (9) away from the bounds, and that the bounds hold.
    #[test]
    fn the_speed_regulator_is_that_of_the_equations(
        omega_m in 100.0..600.0_f64,
        error in -60.0..60.0_f64,
        omega_dot_star in -2000.0..2000.0_f64,
        y_f in -2000.0..2000.0_f64,
        xi_factor in 0.7..1.5_f64,
        xi_dot in -1000.0..1000.0_f64,
        sigma in -0.3..0.3_f64,
        bound in 2.0..20.0_f64,
    ) {
        let units = Units(config());
        let xi = xi_factor / PHI;
        let estimate = Estimate {
            omega: units.speed(P * omega_m),
            omega_bar: units.speed(P * omega_m),
            omega_bar_step: units.speed(P * y_f * TS),
            xi: units.xi(xi),
            xi_step: units.xi(xi_dot * TS),
        };
        let mut state = speed::State { sigma: units.torque(sigma) };
        let bounds = Bounds { min: units.current(-bound), max: units.current(bound) };
        let reference = (
            units.speed(P * (omega_m - error)),
            units.speed(P * omega_dot_star * TS),
        );
        let got = speed::current(
            &units.0.speed, &mut state, reference, &estimate, bounds,
        );
        let torque = -K_P_OMEGA * error + sigma;
        let i_q = 2.0 / (3.0 * P) * xi * torque;
        let tolerance = 0.001 + TABLE_III * 2.0 / (3.0 * P) * xi * (K_P_OMEGA * error).abs();
        if i_q.abs() < bound - tolerance {
            near(units.amperes(got.i.q), i_q, 1e-4, tolerance)?;
            let torque_dot = -K_P_OMEGA * y_f + K_P_OMEGA * omega_dot_star - K_I_OMEGA * error;
            let p_q = 2.0 / (3.0 * P) * (xi_dot * torque + xi * torque_dot);
            near(units.amperes(got.i_q_step) / TS, p_q, TABLE_III, 30.0)?;
            let step = TS * K_I_OMEGA * error;
            near(units.nm(state.sigma), sigma - step, 0.0, TABLE_III * step.abs() + 1e-6)?;
        } else {
            prop_assert!(units.amperes(got.i.q).abs() <= bound + 1e-4);
        }
    }
}

#[test]
fn at_a_bound_the_integrator_only_comes_back() {
    let units = Units(config());
    let bounds = Bounds {
        min: units.current(-1.0),
        max: units.current(1.0),
    };
    let sigma_after = |error_rad_s: f64, sigma: f64| {
        let omega = units.speed(P * 300.0);
        let estimate = Estimate {
            omega,
            omega_bar: omega,
            omega_bar_step: Speed::ZERO,
            xi: units.xi(1.0 / PHI),
            xi_step: InverseFlux::ZERO,
        };
        let mut state = speed::State {
            sigma: units.torque(sigma),
        };
        let reference = (units.speed(P * (300.0 - error_rad_s)), Speed::ZERO);
        let got = speed::current(&units.0.speed, &mut state, reference, &estimate, bounds);
        assert_eq!(got.i_q_step, Current::ZERO);
        units.nm(state.sigma) - sigma
    };
    // Too slow and too much torque asked for already: 1 A is 0.0234 Nm.
    assert!(sigma_after(-50.0, 0.2).abs() < 1e-9);
    // Too fast while the integrator asks for far too much: it falls.
    assert!(sigma_after(1.0, 0.2) < 0.0);
    assert!(sigma_after(50.0, -0.2).abs() < 1e-9);
}

#[test]
fn the_voltage_between_two_samples_follows_the_delay() {
    let run = |delay| {
        let observer = back_emf::Config {
            delay,
            ..config().observer
        };
        let mut state = back_emf::State {
            u_before: Dq {
                d: Voltage::from_num(1.0),
                q: Voltage::ZERO,
            },
            ..back_emf::State::default()
        };
        let now = Dq {
            d: Voltage::from_num(0.5),
            q: Voltage::ZERO,
        };
        back_emf::advance(&observer, &mut state, Speed::ZERO, Dq::default(), now);
        assert_eq!(state.u_before, now);
        state.i.d.to_num::<f64>()
    };
    let (none, half, one) = (run(Delay::None), run(Delay::Half), run(Delay::One));
    assert!((none / one - 0.5).abs() < 1e-6 && (half / one - 0.75).abs() < 1e-6);
    let ahead = Delay::One.advance(Speed::from_num(0.1)).to_num::<f64>();
    assert!((ahead - 0.15).abs() < 1e-9);
}
