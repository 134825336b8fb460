//! The running estimator, fed with the voltages of an ideal motor without resistance and
//! inductance: every error of its angle is its own.

use std::f64::consts::TAU;

use fixed::types::I0F32;
use siskin_control::build::build;
use siskin_control::control::observer;
use siskin_control::control::observer::edges::{self, Sensors};
use siskin_control::control::observer::flux_linkage::{self, HighPass};
use siskin_control::control::observer::{crossing, position};
use siskin_params::{BOSSO_BENCH, Delay, ParamId, Params, parts};
use siskin_units::math::Gain;
use siskin_units::{Angle, Current, FLUX_NOMINAL, Speed, Voltage};

use crate::rig::Bench;

/// 14 poles, the motor of figures 19 to 30.
pub(super) const POLE_PAIRS: f64 = 7.0;
/// Sampling frequency, Hz.
pub(super) const SAMPLE_HZ: f64 = 15_625.0;
/// N, electrical turns per measurement of the speed.
pub(super) const N: f64 = 1.0;

/// Converts this motor's rpm to electrical rad/s; likewise accelerations.
pub(super) fn rad_s(rpm: f64) -> f64 {
    hz(rpm) * TAU
}

/// Converts this motor's rpm to electrical turns per second.
pub(super) fn hz(rpm: f64) -> f64 {
    rpm / 60.0 * POLE_PAIRS
}

/// Returns the phases' fluxes at an angle in turns, in the control's units.
pub(super) fn fluxes(turns: f64) -> [f64; 3] {
    let flux = FLUX_NOMINAL.to_num::<f64>();
    [0.0, -1.0, 1.0].map(|third| flux * libm::cos(TAU * (turns + third / 3.0)))
}

/// Returns the voltages of a period with this change of flux, in the control's units.
pub(super) fn voltages(before: [f64; 3], now: [f64; 3]) -> [Voltage; 3] {
    [0, 1, 2].map(|phase| Voltage::from_num(now[phase] - before[phase]))
}

/// Configures the paper's estimator: what the drive adds is turned off, and the integrators forget
/// nothing. `compensates` is whether the time from a crossing to its sample is compensated.
pub(super) fn config(a_e: f64, compensates: bool) -> edges::Config {
    let mut params = Params::of(&BOSSO_BENCH);
    for (id, value) in [
        (ParamId::MotPolePairs, POLE_PAIRS),
        (ParamId::PwmFreqHz, SAMPLE_HZ),
        (ParamId::CtlObserver, 1.0),
        (ParamId::CtlPosN, N),
        (ParamId::CtlAe, a_e),
    ] {
        params.set(id, value as f32).expect("within the table");
    }
    let board = Bench::default().sensing.board(Delay::One);
    let built = build(&params, &board).expect("the defaults fit, and 0.075 turns a period");
    let observer::Config::Edges(edges) = built.observer else {
        unreachable!("CTL_OBSERVER is 1");
    };
    edges::Config {
        sensors: Sensors::None(parts::FluxCrossings::HERE),
        flux: flux_linkage::Config {
            forget: Gain::ZERO,
            corner: Speed::ZERO,
            high_pass: None,
            ..edges.flux
        },
        crossing: crossing::Config {
            deadband: I0F32::ZERO,
            deadband_angle: Angle::ZERO,
            patience: u32::MAX,
            ..edges.crossing
        },
        position: position::Config {
            whole_turns_above: Speed::ZERO,
            filter_above: Speed::ZERO,
            compensates,
            ..edges.position
        },
        ..edges
    }
}

/// Configures flux integrators with these time constants in place of those that forget nothing.
pub(super) fn integrator(tau_int_s: f64, tau_hpfs_s: Option<f64>) -> flux_linkage::Config {
    let share = |tau_s: f64| {
        let share = -libm::expm1(-1.0 / (SAMPLE_HZ * tau_s));
        Gain::new(share as f32).expect("a share fits")
    };
    let corner = |tau_s: f64| Speed::saturating_from_num(1.0 / (SAMPLE_HZ * tau_s * TAU));
    flux_linkage::Config {
        forget: share(tau_int_s),
        corner: corner(tau_int_s),
        high_pass: tau_hpfs_s.map(|tau_s| HighPass {
            share: share(tau_s),
            corner: corner(tau_s),
        }),
        ..config(0.0, true).flux
    }
}

/// The estimator's output at a sample.
pub(super) struct Said {
    /// Time since the start, s.
    pub(super) time_s: f64,
    /// Estimated less true angle, electrical degrees.
    pub(super) error_deg: f64,
    /// Estimated speed, electrical turns/s.
    pub(super) omega_hz: f64,
}

/// Follows a rotor for a number of samples from the estimator's given state. `angle` is the rotor's
/// in turns after a time in s.
pub(super) fn follow(
    config: &edges::Config,
    mut state: edges::State,
    angle: impl Fn(f64) -> f64,
    samples: u32,
) -> impl Iterator<Item = Said> {
    let mut before = fluxes(angle(0.0));
    (1..=samples).map(move |sample| {
        let time_s = f64::from(sample) / SAMPLE_HZ;
        let turns = angle(time_s);
        let now = fluxes(turns);
        let v = voltages(before, now);
        before = now;
        let got = edges::estimate(config, &mut state, v, [Current::ZERO; 3], 0);
        let error = got.theta.wrapping_sub(Angle::wrapping_from_num(turns));
        Said {
            time_s,
            error_deg: error.to_num::<f64>() * 360.0,
            omega_hz: got.omega.to_num::<f64>() * SAMPLE_HZ,
        }
    })
}

/// Returns the state of an estimator that knows the rotor's position, in turns, and speed, in
/// electrical turns/s.
pub(super) fn begun(config: &edges::Config, turns: f64, omega_hz: f64) -> edges::State {
    let mut state = edges::State::default();
    edges::begin(
        config,
        &mut state,
        Angle::wrapping_from_num(turns),
        Speed::from_num(omega_hz / SAMPLE_HZ),
        [Current::ZERO; 3],
    );
    state
}
