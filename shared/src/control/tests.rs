//! The fixed-point blocks against the papers' equations in double precision and SI units.
//!
//! Inputs are those of the first paper's motor at some thousand rpm, randomly perturbed. Both
//! versions of a block run some periods from the same state; the final difference is bounded.

use proptest::prelude::*;
use std::f64::consts::TAU;

use siskin_params::{BOSSO_BENCH, Board, Delay, ParamId, Params, parts};
use siskin_units::{Angle, Current, InverseFlux, Speed, Torque, Voltage, WideVoltage};

use super::inductance::Factor;
use super::observer::{self, back_emf};
use super::regulator::Feedback;
use super::transform::Dq;
use crate::build::build;
use crate::drive::Config;

mod inductance;
mod motor;
mod outer;
mod regulators;
mod speed;

const NONE: Delay = Delay::None(parts::Bench::HERE);
const HALF: Delay = Delay::Half(parts::Bench::HERE);

const R: f64 = 0.108;
const L: f64 = 30.6e-6;
const PHI: f64 = 1.3e-3;
const P: f64 = 12.0;
const TS: f64 = 1.0 / 15_000.0;

/// Table III, which the defaults reproduce to the rounding of the paper's own figures.
const K_P: f64 = 1178.0;
const K_I: f64 = 340.0;
const K_PE: f64 = 964.0;
const K_IE: f64 = 154.6;
const K_ETA: f64 = 115.8;
const GAMMA: f64 = 6707.0;
const K_F: f64 = 500.0;
const K_P_OMEGA: f64 = 7.1e-3;
const K_I_OMEGA: f64 = 41.7e-3;

/// Tolerance of the computed gains against Table III, whose eigenvalues have three digits.
const TABLE_III: f64 = 0.02;

fn config_with(changes: &[(ParamId, f32)]) -> Config {
    let mut params = Params::of(&BOSSO_BENCH);
    params.set(ParamId::PwmFreqHz, 15_000.0).expect("in range");
    for (id, value) in changes {
        params.set(*id, *value).expect("in range");
    }
    let board = Board {
        delay: NONE,
        ..Board::BENCH
    };
    build(&params, &board).expect("it makes a drive")
}

/// The adaptive back-EMF observer of `CTL_OBSERVER` 0.
fn published(config: &Config) -> back_emf::Config {
    match &config.observer {
        observer::Config::BackEmf(back_emf, _) => back_emf.clone(),
        other => panic!("{other:?}"),
    }
}

/// Returns that observer's input from a period's feedback.
fn feedback(omega: Speed, i: Dq<Current>) -> Feedback {
    Feedback {
        omega,
        i,
        i_hat: i,
        h_hat: Dq::default(),
        inductance: Factor::ONE,
    }
}

/// Converts between SI and the control's units.
#[derive(Clone)]
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
    fn wide(&self, v: f64) -> WideVoltage {
        WideVoltage::from_num(v / f64::from(self.0.scale.voltage_v))
    }
    fn wide_volts(&self, u: WideVoltage) -> f64 {
        u.to_num::<f64>() * f64::from(self.0.scale.voltage_v)
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
        let units = Units(config_with(&[(ParamId::CtlObserver, 0.0)]));
        let observer = &published(&units.0);
        let i_hat = [i[0] - i_error[0], i[1] - i_error[1]];
        let xi = flux_factor / PHI;
        let mut state = back_emf::State {
            i: Dq { d: units.current(i_hat[0]), q: units.current(i_hat[1]) },
            h: Dq { d: units.voltage(h_d), q: units.voltage(h_q) },
            xi: units.xi(xi),
            omega_f: units.speed(omega_f),
            ..back_emf::State::default()
        };

        let (estimate, slow) = back_emf::estimate(observer, &mut state, None, Speed::ZERO);
        let omega_bar = xi * h_d.hypot(h_q);
        let omega = omega_bar + K_ETA * h_d;
        near(units.rad_s(estimate.omega_bar), omega_bar, 1e-5, 0.01)?;
        near(units.rad_s(estimate.omega), omega, 1e-5, 0.01 + TABLE_III * (K_ETA * h_d).abs())?;
        let y_f = -K_F * (omega_f - omega_bar);
        near(units.rad_s(slow.omega_bar_step) / TS, y_f, TABLE_III, 10.0)?;
        near(units.rad_s(state.omega_f), omega_f + y_f * TS, 0.0, TABLE_III * (y_f * TS).abs() + 0.01)?;

        prop_assert!(!slow.lost);
        near(units.per_wb(state.xi), xi + TS * GAMMA * h_d, 0.0, 0.03 * TS * GAMMA * h_d.abs() + 0.01)?;

        let measured = Dq { d: units.current(i[0]), q: units.current(i[1]) };
        let applied = Dq { d: units.voltage(u[0]), q: units.voltage(u[1]) };
        back_emf::advance(observer, &mut state, &feedback(estimate.omega, measured), applied);
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
}

proptest! {
    /// The loop in place of (7): ω̂_i += T_s·(ω_n²·ε + ω̇*), ω̂ = ω̂_i + 2·ω_n·ε, ε = ĥ_d/|ĥ|.
    #[test]
    fn the_cured_observer_is_that_of_its_loop(
        h_d in -8.0..8.0_f64,
        h_q in -12.0..8.0_f64,
        omega_i in 500.0..7000.0_f64,
        planned in -25_000.0..25_000.0_f64,
    ) {
        prop_assume!(h_d.hypot(h_q) > 0.1);
        let cured = [(ParamId::CtlObserver, 0.0), (ParamId::CtlObsCure, 1.0)];
        let units = Units(config_with(&cured));
        let config = published(&units.0);
        let mut state = back_emf::State {
            h: Dq { d: units.voltage(h_d), q: units.voltage(h_q) },
            xi: config.xi_nominal,
            omega_i: units.speed(omega_i),
            ..back_emf::State::default()
        };
        let step = units.speed(planned * TS);
        let (got, slow) = back_emf::estimate(&config, &mut state, None, step);
        let epsilon = h_d / h_d.hypot(h_q);
        let omega_n = 400.0;
        let next = omega_i + TS * (omega_n * omega_n * epsilon + planned);
        // ε has twelve bits: the upper fourteen of |ĥ|'s 28, and a magnitude accurate to 0.1 %.
        let length = units.voltage(h_d.hypot(h_q)).to_bits();
        let part = 1e-3 + 1.0 / 4096.0 + 1.1 * 16_384.0 / f64::from(length);
        near(units.rad_s(got.omega_bar), next, 0.0, 0.01 + part * TS * omega_n * omega_n)?;
        near(units.rad_s(got.omega), next + 2.0 * omega_n * epsilon, 0.0, 0.01 + part * 2.1 * omega_n)?;
        near(units.rad_s(slow.omega_bar_step), next - omega_i, 0.0, 0.01 + part * TS * omega_n * omega_n)?;
        near(units.rad_s(state.omega_i), units.rad_s(got.omega_bar), 0.0, 1e-9)?;
        prop_assert_eq!(slow.xi, config.xi_nominal);
        prop_assert_eq!(state.xi, config.xi_nominal);
        // The rotor cannot be where ĥ opposes what the frame expects.
        prop_assert_eq!(slow.lost, !state.h.q.is_negative());
    }
}

#[test]
fn the_voltage_between_two_samples_follows_the_delay() {
    let run = |delay| {
        let observer = back_emf::Config {
            delay,
            ..published(&config_with(&[(ParamId::CtlObserver, 0.0)]))
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
        let standing = feedback(Speed::ZERO, Dq::default());
        back_emf::advance(&observer, &mut state, &standing, now);
        assert_eq!(state.u_before, now);
        state.i.d.to_num::<f64>()
    };
    let (none, half, one) = (run(NONE), run(HALF), run(Delay::One));
    assert!((none / one - 0.5).abs() < 1e-6 && (half / one - 0.75).abs() < 1e-6);
    let ahead = Delay::One.advance(Speed::from_num(0.1)).to_num::<f64>();
    assert!((ahead - 0.15).abs() < 1e-9);
}

#[test]
fn a_rotor_that_is_caught_without_current_is_predicted_without_current() {
    for delay in [NONE, HALF, Delay::One] {
        let units = Units(config_with(&[(ParamId::CtlObserver, 0.0)]));
        let config = back_emf::Config {
            delay,
            ..published(&units.0)
        };
        for omega in [500.0, 3000.0, 7000.0] {
            let speed = units.speed(omega);
            let mut state = back_emf::begin(&config, Angle::ZERO, speed);
            let emf = Dq {
                d: Voltage::ZERO,
                q: units.voltage(omega * PHI),
            };
            back_emf::advance(&config, &mut state, &feedback(speed, Dq::default()), emf);
            let i = [state.i.d, state.i.q].map(|i| units.amperes(i));
            assert!(i[0].hypot(i[1]) < 1e-3, "{delay:?}, {omega}: {i:?}");
        }
    }
}
