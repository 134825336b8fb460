//! The current regulators against their equations, and in closed loop with the motor.

use proptest::prelude::*;
use std::f64::consts::TAU;

use siskin_params::ParamId;
use siskin_units::{Current, Voltage, WideVoltage};

use super::motor::{Loop, Motor};
use super::{K_IE, K_PE, L, P, PHI, R, TABLE_III, TS, Units, config_with, near};
use crate::control::inductance::Factor;
use crate::control::regulator::{Feedback, Reference, State};
use crate::control::transform::Dq;

/// `CTL_REGULATOR`.
const ALL: [f32; 3] = [0.0, 1.0, 2.0];
const SYNCHRONOUS: f32 = 1.0;
const MODIFIED: f32 = 2.0;

/// Default bandwidth, 1/s.
const BANDWIDTH: f64 = TAU * 375.0;

fn units(regulator: f32) -> Units {
    Units(config_with(&[(ParamId::CtlRegulator, regulator)]))
}

/// Amperes, volts and rad/s of one call.
#[derive(Clone, Copy, Debug)]
struct Case {
    omega: f64,
    i: [f64; 2],
    i_hat: [f64; 2],
    h: [f64; 2],
    i_star: [f64; 2],
    p_q_star: f64,
    u_ff: f64,
    factor: f64,
}

fn cases() -> impl Strategy<Value = Case> {
    (
        (300.0..7500.0_f64, 0.5..1.7_f64, -1.0..1.0_f64),
        prop::array::uniform2(-15.0..15.0_f64),
        prop::array::uniform2(-15.0..15.0_f64),
        prop::array::uniform2(-10.0..10.0_f64),
        prop::array::uniform2(-15.0..15.0_f64),
        -3000.0..3000.0_f64,
    )
        .prop_map(
            |((omega, factor, u_ff), i, i_hat, h, i_star, p_q_star)| Case {
                omega,
                i,
                i_hat,
                h,
                i_star,
                p_q_star,
                u_ff,
                factor,
            },
        )
}

impl Case {
    fn wanted(&self, units: &Units) -> Reference {
        Reference {
            i: currents(units, self.i_star),
            i_q_step: units.current(self.p_q_star * TS),
            u_q: units.voltage(self.u_ff),
        }
    }

    fn feedback(&self, units: &Units) -> Feedback {
        Feedback {
            omega: units.speed(self.omega),
            i: currents(units, self.i),
            i_hat: currents(units, self.i_hat),
            h_hat: Dq {
                d: units.wide(self.h[0]),
                q: units.wide(self.h[1]),
            },
            inductance: Factor::new(fixed::types::I2F30::from_num(self.factor)),
        }
    }
}

fn currents(units: &Units, [d, q]: [f64; 2]) -> Dq<Current> {
    Dq {
        d: units.current(d),
        q: units.current(q),
    }
}

fn voltages(units: &Units, [d, q]: [f64; 2]) -> Dq<Voltage> {
    Dq {
        d: units.voltage(d),
        q: units.voltage(q),
    }
}

/// Returns the state in which the integrators hold these voltages: with no current and no reference they are all
/// that remains.
fn at(units: &Units, sigma: [f64; 2]) -> State {
    let mut state = State::default();
    let idle = Case {
        omega: 0.0,
        i: [0.0; 2],
        i_hat: [0.0; 2],
        h: [0.0; 2],
        i_star: [0.0; 2],
        p_q_star: 0.0,
        u_ff: 0.0,
        factor: 1.0,
    };
    units.0.regulator.preset(
        &mut state,
        voltages(units, sigma),
        &idle.wanted(units),
        &idle.feedback(units),
    );
    state
}

/// Returns the voltage now, and after the integrators have advanced by one period.
fn two_periods(units: &Units, state: &mut State, case: &Case) -> [[f64; 2]; 2] {
    let regulator = &units.0.regulator;
    let (wanted, feedback) = (case.wanted(units), case.feedback(units));
    let volts = |u: Dq<WideVoltage>| [units.wide_volts(u.d), units.wide_volts(u.q)];
    regulator.schedule_gains(state, feedback.omega, feedback.inductance);
    let now = volts(regulator.voltage(state, &wanted, &feedback));
    regulator.integrate(state, &wanted, &feedback);
    [now, volts(regulator.voltage(state, &wanted, &feedback))]
}

proptest! {
    /// (10) and its integrators.
    #[test]
    fn the_observer_based_one_is_that_of_the_equations(
        case in cases(),
        sigma in prop::array::uniform2(-1.0..1.0_f64),
    ) {
        let units = units(0.0);
        let [now, next] = two_periods(&units, &mut at(&units, sigma), &case);
        let Case { omega, i, i_hat, h, i_star, p_q_star, u_ff, factor } = case;
        let e = [i_hat[0] - i_star[0], i_hat[1] - i_star[1]];
        let l = L * factor;
        let u_d = R * i_star[0] - h[0] - l * omega * i[1] - L * K_PE * e[0] + sigma[0];
        let u_q = R * i_star[1] - h[1] + l * omega * i[0] + L * (p_q_star - K_PE * e[1])
            + sigma[1] + u_ff;
        for (axis, wanted) in [u_d, u_q].into_iter().enumerate() {
            near(now[axis], wanted, 1e-5, 2e-4 + TABLE_III * L * K_PE * e[axis].abs())?;
            let step = -TS * K_IE * e[axis];
            near(next[axis] - now[axis], step, TABLE_III, 1e-5)?;
        }
    }

    /// Figure 10 with its decoupling: starts from zero volts and these currents.
    #[test]
    fn the_synchronous_one_is_that_of_the_equations(case in cases(), before in cases()) {
        let units = units(SYNCHRONOUS);
        let mut state = State::default();
        let (wanted, feedback) = (before.wanted(&units), before.feedback(&units));
        units.0.regulator.preset(&mut state, Dq::default(), &wanted, &feedback);
        let [now, next] = two_periods(&units, &mut state, &case);

        let k_p = BANDWIDTH * L;
        let forced = |case: &Case, model: [f64; 2]| {
            let Case { omega, i, h, i_star, u_ff, factor, .. } = case;
            let l = L * factor;
            [
                k_p * (i_star[0] - i[0]) - omega * l * model[1],
                k_p * (i_star[1] - i[1]) + omega * l * model[0] - h[1] + u_ff,
            ]
        };
        let sigma = forced(&before, before.i).map(|u| -u);
        let first = forced(&case, before.i);
        let follow = |axis: usize| {
            before.i[axis] + BANDWIDTH * TS * (case.i_star[axis] - before.i[axis])
        };
        let second = forced(&case, [follow(0), follow(1)]);
        for axis in 0..2 {
            near(now[axis], first[axis] + sigma[axis], 1e-5, 3e-4)?;
            let step = TS * BANDWIDTH * R * (case.i_star[axis] - case.i[axis]);
            near(next[axis], second[axis] + sigma[axis] + step, 1e-5, 3e-4)?;
        }
    }

    /// Figure 11: the q-axis PI sets the length, the d-axis PI the phase.
    #[test]
    fn the_modified_one_is_that_of_the_figure(
        case in cases(),
        length in 0.5..12.0_f64,
        phase_deg in -40.0..40.0_f64,
    ) {
        let units = units(MODIFIED);
        let phase = phase_deg.to_radians();
        let sigma = [-length * phase.sin(), length * phase.cos()];
        let [now, next] = two_periods(&units, &mut at(&units, sigma), &case);
        let Case { i, i_star, u_ff, .. } = case;
        let e = [i[0] - i_star[0], i_star[1] - i[1]];
        let top = PHI * 6000.0 * P * TAU / 60.0;
        let length_at = |integrated: f64| {
            length + BANDWIDTH * (L * e[1] + TS * R * e[1] * integrated) + u_ff
        };
        let wanted = |integrated: f64| {
            let length = length_at(integrated);
            // The integral used the sign the length had then.
            let proportional = L * length.signum();
            let integral = TS * R * integrated * length_at(0.0).signum();
            let phase = phase + BANDWIDTH / top * (proportional + integral) * e[0];
            let phase = phase.clamp(-TAU / 4.0, TAU / 4.0);
            [-length * phase.sin(), length * phase.cos()]
        };
        for (got, wanted) in [(now, wanted(0.0)), (next, wanted(1.0))] {
            for axis in 0..2 {
                // The phase comes from an arctangent accurate to 0.02°, of up to 25 V.
                near(got[axis], wanted[axis], 1e-3, 0.012)?;
            }
        }
    }

    /// A regulator continues smoothly from whatever applied the voltage before.
    #[test]
    fn each_takes_over_without_a_jump(case in cases(), u in prop::array::uniform2(-10.0..10.0_f64)) {
        for kind in ALL {
            let units = units(kind);
            let regulator = &units.0.regulator;
            let (wanted, feedback) = (case.wanted(&units), case.feedback(&units));
            let mut state = State::default();
            regulator.preset(&mut state, voltages(&units, u), &wanted, &feedback);
            let got = regulator.voltage(&state, &wanted, &feedback);
            let settled = kind != MODIFIED || u[1].abs() > 2.0 * u[0].abs() && (case.i[0] - case.i_star[0]).abs() < 10.0;
            if settled {
                // The modified one's angle is accurate to 0.02°.
                near(units.wide_volts(got.d), u[0], 1e-5, 6e-3)?;
                near(units.wide_volts(got.q), u[1], 1e-5, 6e-3)?;
            }
        }
    }

    /// The current at which the voltage is the one asked for.
    #[test]
    fn each_finds_the_current_of_a_voltage(case in cases(), u_q in -10.0..10.0_f64) {
        for kind in ALL {
            let units = units(kind);
            let regulator = &units.0.regulator;
            let case = Case { p_q_star: 0.0, ..case };
            let (wanted, feedback) = (case.wanted(&units), case.feedback(&units));
            let state = State::default();
            let i_q = regulator.current_at(&state, &wanted, &feedback, units.voltage(u_q));
            let u = regulator.voltage(&state, &wanted.with_i_q(i_q), &feedback);
            let got = match kind {
                MODIFIED => u_q.signum() * units.wide_volts(u.d).hypot(units.wide_volts(u.q)),
                _ => units.wide_volts(u.q),
            };
            // Far from any actual current, i_q* minus i_q saturates at the type's 213 A.
            if units.amperes(i_q).abs() < 190.0 {
                near(got, u_q, 1e-4, 5e-3)?;
            }
        }
    }
}

impl Loop {
    /// Runs periods with these currents, A; returns i_d and i_q at the start of each.
    fn run(&mut self, seconds: f64, i_star: [f64; 2]) -> std::vec::Vec<(f64, f64)> {
        let wanted = Reference {
            i: currents(&self.units, i_star),
            ..Reference::default()
        };
        let periods = (seconds / TS) as usize;
        (0..periods)
            .map(|_| {
                let i = self.motor.i_dq();
                self.period(&wanted);
                i
            })
            .collect()
    }
}

#[test]
fn the_current_arrives_without_a_steady_error() {
    for kind in ALL {
        for rpm in [300.0, 3000.0, 6000.0] {
            let mut bench = Loop::new(units(kind), Motor::held(rpm));
            bench.run(0.05, [0.0, 0.0]);
            for i_q in [8.0, -6.0, 1.0] {
                let last = *bench.run(0.3, [0.0, i_q]).last().expect("it has run");
                let near = last.0.abs() < 0.02 && (last.1 - i_q).abs() < 0.02;
                assert!(near, "{kind} at {rpm} rpm, {i_q} A: {last:?}");
            }
        }
    }
}

#[test]
fn a_step_of_the_synchronous_one_is_of_first_order_and_decoupled() {
    for rpm in [300.0, 3000.0, 6000.0] {
        let mut bench = Loop::new(units(SYNCHRONOUS), Motor::held(rpm));
        bench.run(0.05, [0.0, 0.0]);
        let step = bench.run(0.01, [0.0, 10.0]);
        // With the PI's zero on the winding's pole the current is the integral of its error, whose voltage acts one
        // period later; the decoupling leaves a tenth of the step.
        let mut expected = [0.0; 2];
        for (period, i) in step.iter().enumerate() {
            let off = (i.1 - expected[0]).abs();
            assert!(
                off < 1.0,
                "{rpm}, {period}: {i:?} instead of {}",
                expected[0]
            );
            let [now, next] = expected;
            let after = next + BANDWIDTH * TS * (10.0 - now);
            expected = [next, after];
        }
        let across = step.iter().map(|i| i.0.abs()).fold(0.0, f64::max);
        assert!(across < 2.0, "{rpm}: {across}");
    }
}

/// Braking at high speed with a current beyond its reference: at 6000 rpm −56 A along q induce the full 13 V along
/// d, and with no voltage left along q they would persist.
#[test]
fn a_current_beyond_its_bound_comes_back_where_its_drop_takes_the_whole_voltage() {
    for kind in ALL {
        let mut bench = Loop::new(units(kind), Motor::held(6000.0));
        bench.vector_max = bench.units.voltage(13.0);
        bench.motor.i = (-16.0, -56.0);
        let i = *bench.run(0.05, [0.0, -30.0]).last().expect("it has run");
        assert!((i.1 + 30.0).abs() < 0.1, "{kind}: {i:?}");
    }
}

#[test]
fn a_limited_voltage_winds_nothing_up() {
    for kind in ALL {
        // At 6000 rpm 10 V are too little for 8 A: the back-EMF alone is 9.8 V.
        let mut bench = Loop::new(units(kind), Motor::held(6000.0));
        bench.run(0.05, [0.0, 0.0]);
        bench.vector_max = bench.units.voltage(10.0);
        let limited = *bench.run(0.2, [0.0, 8.0]).last().expect("it has run");
        assert!(limited.1 < 6.0, "{kind}: {limited:?}");
        // When less is requested it obeys at once, like one that was never limited.
        let back = bench.run(0.01, [0.0, 0.0]);
        let least = back.iter().map(|i| i.1).fold(0.0, f64::min);
        assert!(least > -2.0, "{kind}: {least}");
        let last = back.last().expect("it has run").1;
        assert!(last.abs() < 0.3, "{kind}: {last}");
    }
}
