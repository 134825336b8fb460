//! The flux observers against section 2.2 in double precision and SI units.

use proptest::prelude::*;
use std::f64::consts::TAU;

use siskin_params::{BOSSO_BENCH, Board, ParamId, Params};
use siskin_units::Scale;

use super::*;
use crate::build::build;
use crate::control::observer;

const R: f64 = 0.108;
const L: f64 = 30.6e-6;
const PHI: f64 = 1.3e-3;
const TS: f64 = 1.0 / 24_000.0;
/// 5.671 over the lowest electrical speed: half of 300 rpm with 12 pole pairs.
const TAU_INT: f64 = 5.671 / (150.0 * 12.0 * TAU / 60.0);
const TAU_HPFS: f64 = 10.0 * TAU_INT;

/// Forms of `CTL_FLUX_FORM`.
const FIRST: f32 = 0.0;
const SECOND: f32 = 1.0;
const FIRST_FIXED: f32 = 2.0;

fn config(form: f32) -> (Config, Scale) {
    let mut params = Params::of(&BOSSO_BENCH);
    params.set(ParamId::CtlObserver, 1.0).expect("in range");
    params.set(ParamId::CtlFluxForm, form).expect("in range");
    let config = build(&params, &Board::BENCH).expect("the defaults fit");
    let observer::Config::Edges(edges) = config.observer else {
        panic!("it is one by edges");
    };
    (edges.flux, config.scale)
}

fn wb(scale: &Scale, flux: Flux) -> f64 {
    flux.to_num::<f64>() * f64::from(scale.flux_wb())
}

fn flux(scale: &Scale, wb: f64) -> Flux {
    Flux::from_num(wb / f64::from(scale.flux_wb()))
}

fn volts(scale: &Scale, v: f64) -> Voltage {
    Voltage::from_num(v / f64::from(scale.voltage_v))
}

fn amperes(scale: &Scale, a: f64) -> Current {
    Current::from_num(a / f64::from(scale.current_a))
}

/// Returns the three phases of a vector of this length and angle in turns.
fn three(length: f64, turns: f64) -> [f64; 3] {
    [0.0, -1.0, 1.0].map(|third| length * (TAU * (turns + third / 3.0)).cos())
}

/// A motor at constant speed with a constant current along q.
struct Motor {
    hz: f64,
    flux_wb: f64,
    i_q: f64,
    sample: i32,
}

impl Motor {
    fn turns(&self, sample: i32) -> f64 {
        self.hz * TS * f64::from(sample)
    }
    fn current(&self, sample: i32) -> [f64; 3] {
        three(self.i_q, self.turns(sample) + 0.25)
    }
    fn linked(&self, sample: i32) -> [f64; 3] {
        let (rotor, i) = (
            three(self.flux_wb, self.turns(sample)),
            self.current(sample),
        );
        [0, 1, 2].map(|k| rotor[k] + L * i[k])
    }
    /// Advances one sample; returns the mean phase voltages since the last one and the currents.
    fn step(&mut self) -> ([f64; 3], [f64; 3]) {
        self.sample += 1;
        let (now, before) = (self.linked(self.sample), self.linked(self.sample - 1));
        let (i, i_before) = (self.current(self.sample), self.current(self.sample - 1));
        let v = [0, 1, 2].map(|k| (now[k] - before[k]) / TS + R * (i[k] + i_before[k]) / 2.0);
        (v, i)
    }
    fn run(&mut self, config: &Config, scale: &Scale, state: &mut State, samples: u32) {
        for _ in 0..samples {
            let (v, i) = self.step();
            let v = v.map(|v| volts(scale, v));
            advance(config, state, v, i.map(|a| amperes(scale, a)));
        }
    }
}

/// Returns the length, and the angle in degrees, of three phases.
fn vector(scale: &Scale, phases: &[Flux; 3]) -> (f64, f64) {
    let [a, b, c] = phases.map(|flux| wb(scale, flux));
    let (alpha, beta) = ((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt());
    (alpha.hypot(beta), beta.atan2(alpha).to_degrees())
}

fn wrapped(degrees: f64) -> f64 {
    (degrees + 180.0).rem_euclid(360.0) - 180.0
}

/// Returns gain and lead relative to an integrator, after `seconds`.
fn response(form: f32, hz: f64, seconds: f64) -> (f64, f64) {
    let (config, scale) = config(form);
    let mut state = State::default();
    let mut motor = Motor {
        hz,
        flux_wb: PHI,
        i_q: 0.0,
        sample: 0,
    };
    motor.run(&config, &scale, &mut state, (seconds / TS) as u32);
    let (length, degrees) = vector(&scale, &state.lambda);
    (
        length / PHI,
        wrapped(degrees - motor.turns(motor.sample) * 360.0),
    )
}

proptest! {
    /// One period of figure 17 from any state away from the limits.
    #[test]
    fn a_period_is_that_of_the_equations(
        psi in -1.2e-3..1.2e-3_f64,
        mean in -1e-4..1e-4_f64,
        v in -15.0..15.0_f64,
        i in -15.0..15.0_f64,
        i_before in -15.0..15.0_f64,
        second in any::<bool>(),
    ) {
        let (config, scale) = config(if second { SECOND } else { FIRST });
        let mut state = State {
            psi: [flux(&scale, psi); 3],
            mean: [flux(&scale, mean); 3],
            i_before: [amperes(&scale, i_before); 3],
            ..State::default()
        };
        advance(&config, &mut state, [volts(&scale, v); 3], [amperes(&scale, i); 3]);
        let share = |tau: f64| 1.0 - (-TS / tau).exp();
        let limit = 1.25 * PHI;
        let integral = psi * (1.0 - share(TAU_INT)) + (v - R * (i + i_before) / 2.0) * TS;
        let integral = integral.clamp(-limit - 20.0 * L, limit + 20.0 * L);
        let slow = mean + share(TAU_HPFS) * (integral - mean);
        let passed = if second { integral - slow } else { integral };
        let wanted = (passed - L * i).clamp(-limit, limit);
        for phase in 0..3 {
            let got = wb(&scale, state.lambda[phase]);
            prop_assert!((got - wanted).abs() < 2e-9, "{got} instead of {wanted}");
        }
    }

    /// No input overflows, and λ̂ and its amplitude stay within their bounds.
    #[test]
    fn any_input_is_survived(words in prop::collection::vec(any::<[i32; 6]>(), 1..40)) {
        let (config, _) = config(SECOND);
        let mut state = State::default();
        for [a, b, c, d, e, f] in words {
            let v = [a, b, c].map(Voltage::from_bits);
            advance(&config, &mut state, v, [d, e, f].map(Current::from_bits));
            let bound = state.amplitude + (state.amplitude >> 2);
            prop_assert!(state.lambda.iter().all(|lambda| lambda.saturating_abs() <= bound));
            let measured = measure(&state.lambda, Sector::of(Angle::from_bits(a)));
            adapt(&config, &mut state, measured);
            prop_assert!((AMPLITUDE_MIN..=AMPLITUDE_MAX).contains(&state.amplitude));
        }
    }
}

#[test]
fn the_first_order_leads_by_the_papers_angle() {
    for hz in [15.0, 30.0, 60.0, 300.0, 1200.0] {
        let product = TAU_INT * TAU * hz;
        let (gain, lead) = response(FIRST, hz, 0.5);
        // τ·s/(τ·s + 1), over the integrator.
        let wanted = product / product.hypot(1.0);
        assert!((gain - wanted).abs() < 0.002, "{hz}: {gain}, {wanted}");
        let wanted = 90.0 - product.atan().to_degrees();
        assert!((lead - wanted).abs() < 0.1, "{hz}: {lead}, {wanted}");
    }
    // The lowest speed is that of 10° (2.2.2).
    let (_, lead) = response(FIRST, 30.0, 0.5);
    assert!((lead - 10.0).abs() < 0.1, "{lead}");
}

#[test]
fn the_second_order_leads_by_both_angles() {
    for hz in [15.0, 30.0, 60.0, 300.0, 1200.0] {
        let (low, high) = (TAU_INT * TAU * hz, TAU_HPFS * TAU * hz);
        let (gain, lead) = response(SECOND, hz, 3.0);
        let wanted = low / low.hypot(1.0) * high / high.hypot(1.0);
        assert!((gain - wanted).abs() < 0.002, "{hz}: {gain}, {wanted}");
        let wanted = 180.0 - low.atan().to_degrees() - high.atan().to_degrees();
        assert!((lead - wanted).abs() < 0.1, "{hz}: {lead}, {wanted}");
    }
}

#[test]
fn the_lead_is_known() {
    for (form, orders) in [(FIRST, 1.0), (SECOND, 2.0)] {
        let (config, _) = config(form);
        for hz in [10.0, 30.0, 200.0, 1500.0] {
            let omega = Speed::from_num(hz * TS);
            let got = lead(&config, omega).to_num::<f64>() * 360.0;
            let second = 90.0 - (TAU_HPFS * TAU * hz).atan().to_degrees();
            let first = 90.0 - (TAU_INT * TAU * hz).atan().to_degrees();
            let wanted = first + (orders - 1.0) * second;
            assert!((got - wanted).abs() < 0.05, "{hz}: {got}, {wanted}");
        }
        assert_eq!(lead(&config, Speed::ZERO), Angle::ZERO);
    }
}

#[test]
fn a_bias_is_multiplied_by_the_time_constant_or_taken_away() {
    let settle = |form: f32| {
        let (config, scale) = config(form);
        let mut state = State::default();
        for _ in 0..(4.0 / TS) as u32 {
            let i = amperes(&scale, 0.05);
            advance(&config, &mut state, [volts(&scale, 0.01); 3], [i; 3]);
        }
        wb(&scale, state.lambda[0])
    };
    // (v_DC − i_DC·R)·τ_int − i_DC·L_s.
    let wanted = (0.01 - 0.05 * R) * TAU_INT - 0.05 * L;
    let got = settle(FIRST);
    assert!((got / wanted - 1.0).abs() < 0.01, "{got}, {wanted}");
    // The high-pass leaves what bypasses the integrator: i_DC·L_s.
    let got = settle(SECOND);
    assert!((got + 0.05 * L).abs() < 1e-7, "{got}");
}

#[test]
fn the_stators_flux_is_taken_away() {
    let (config, scale) = config(FIRST);
    let mut state = State::default();
    let mut motor = Motor {
        hz: 600.0,
        flux_wb: PHI,
        i_q: 15.0,
        sample: 0,
    };
    motor.run(&config, &scale, &mut state, 12_000);
    let (length, degrees) = vector(&scale, &state.lambda);
    assert!((length / PHI - 1.0).abs() < 0.01, "{length}");
    // The integrator leads by 0.51° for the stator's flux too, at right angles to the rotor's.
    let error = wrapped(degrees - motor.turns(motor.sample) * 360.0 - 0.51);
    assert!(error.abs() < 0.1, "{error}");
}

#[test]
fn the_limits_are_those_of_flux_and_current() {
    let (config, scale) = config(FIRST_FIXED);
    let mut state = State::default();
    for _ in 0..1000 {
        let high = volts(&scale, 20.0);
        advance(&config, &mut state, [high, -high, high], [Current::ZERO; 3]);
        adapt(&config, &mut state, AMPLITUDE_MAX);
    }
    let [a, b, _] = state.psi.map(|psi| wb(&scale, psi));
    // λ_max + i_max·L_s, with 20 A of LIM_PHASE_A and a quarter above the stated flux.
    let wanted = 1.25 * PHI + 20.0 * L;
    assert!(
        (a - wanted).abs() < 1e-7 && (b + wanted).abs() < 1e-7,
        "{a}"
    );
    let [a, b, _] = state.lambda.map(|lambda| wb(&scale, lambda));
    assert!((a - 1.25 * PHI).abs() < 1e-7 && (b + 1.25 * PHI).abs() < 1e-7);
}

#[test]
fn adaptive_limits_find_a_flux_that_is_stated_wrong_by_40_per_cent() {
    for share in [0.6, 1.4] {
        let (config, scale) = config(FIRST);
        let mut state = State::default();
        let mut motor = Motor {
            hz: 400.0,
            flux_wb: share * PHI,
            i_q: 5.0,
            sample: 0,
        };
        let mut sector = Sector::default();
        // 0.1 s.
        for _ in 0..2400 {
            motor.run(&config, &scale, &mut state, 1);
            let now = Sector::of(Angle::wrapping_from_num(motor.turns(motor.sample)));
            if now != sector {
                sector = now;
                let measured = measure(&state.lambda, sector);
                adapt(&config, &mut state, measured);
            }
        }
        let found = wb(&scale, state.amplitude) / PHI;
        assert!((found - share).abs() < 0.02, "{share}: {found}");
    }
}

#[test]
fn it_begins_without_a_transient() {
    for form in [FIRST, SECOND] {
        for hz in [30.0, 300.0] {
            let (config, scale) = config(form);
            let mut motor = Motor {
                hz,
                flux_wb: PHI,
                i_q: 5.0,
                sample: 1000,
            };
            let mut state = State::default();
            let theta = Angle::wrapping_from_num(motor.turns(1000));
            let omega = Speed::from_num(hz * TS);
            let i = motor.current(1000).map(|a| amperes(&scale, a));
            begin(&config, &mut state, theta, omega, i);
            for _ in 0..200 {
                motor.run(&config, &scale, &mut state, 24);
                let (_, degrees) = vector(&scale, &state.lambda);
                let expected = lead(&config, omega).to_num::<f64>() * 360.0;
                let error = wrapped(degrees - motor.turns(motor.sample) * 360.0 - expected);
                // What the filters do to the stator's flux, up to 1.7° at 30 Hz, is no transient.
                assert!(error.abs() < 2.0, "{form} {hz}: {error}");
            }
        }
    }
}
