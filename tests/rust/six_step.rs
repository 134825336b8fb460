//! The six-step drive on its bench, with switches, diodes and a floating phase.

use siskin_control::build::build;
use siskin_control::drive::{Fault, Phase, Setpoint};
use siskin_emulator::plant::Fidelity;
use siskin_emulator::rig::{Bench, Rig};
use siskin_params::{BOSSO_BENCH, ParamId, Params};

const SIX_STEP: [(ParamId, f32); 2] = [(ParamId::CtlDrive, 1.0), (ParamId::PwmFreqHz, 40_000.0)];

fn bench() -> Bench {
    Bench {
        plant: Fidelity::Switching,
        ..Bench::default()
    }
}

fn rig(bench: Bench, changes: &[(ParamId, f32)]) -> Rig {
    let mut params = Params::of(&BOSSO_BENCH);
    for (id, value) in SIX_STEP.iter().chain(changes) {
        params.set(*id, *value).expect("in range");
    }
    let board = bench.sensing.board(bench.delay);
    let config = build(&params, &board).expect("the parameters fit the bench");
    Rig::new(bench, config)
}

fn rpm(rig: &Rig, rpm: f32) -> Setpoint {
    Setpoint::Speed(rig.config().scale.speed_from_rpm(rpm))
}

/// What a stretch of time showed.
#[derive(Debug, Default)]
struct Seen {
    /// Mean speed over the last tenth of a second.
    rpm: f64,
    /// When 300 rpm was reached, s.
    at_300_s: Option<f64>,
    /// How often it entered Ramp.
    starts: u32,
    /// Largest phase current, A.
    most_a: f64,
    /// Largest angle error in Run, degrees.
    error_deg: f64,
}

fn run(rig: &mut Rig, setpoint: Setpoint, time_s: f64) -> Seen {
    let periods = (time_s / rig.period_s()) as u32;
    let tail = (0.1 / rig.period_s()) as u32;
    let mut seen = Seen::default();
    let mut before = Phase::Idle;
    for k in 0..periods {
        let period = rig.period(setpoint);
        let snapshot = rig.snapshot();
        if periods - k <= tail {
            seen.rpm += period.rpm() / f64::from(tail);
        }
        if seen.at_300_s.is_none() && period.rpm().abs() > 300.0 {
            seen.at_300_s = Some(f64::from(k) * rig.period_s());
        }
        seen.starts += u32::from(snapshot.phase == Phase::Ramp && before != Phase::Ramp);
        before = snapshot.phase;
        for current_a in period.motion.currents_a {
            seen.most_a = seen.most_a.max(current_a.abs());
        }
        if snapshot.phase == Phase::Run {
            seen.error_deg = seen.error_deg.max(period.angle_error_deg(&snapshot).abs());
        }
    }
    seen
}

#[test]
fn it_starts_from_any_angle_at_the_first_attempt() {
    for k in 0..16_u64 {
        let mut rig = rig(
            Bench {
                seed: k + 100,
                initial_angle_turns: (k as f64 + 0.31) / 16.0,
                ..bench()
            },
            &[],
        );
        let setpoint = rpm(&rig, 1000.0);
        let seen = run(&mut rig, setpoint, 0.9);
        assert!(rig.snapshot().faults.is_empty(), "{k}: {seen:?}");
        assert!((seen.rpm - 1000.0).abs() < 20.0, "{k}: {seen:?}");
        assert!(seen.at_300_s.is_some_and(|s| s < 0.6), "{k}: {seen:?}");
        assert_eq!(seen.starts, 1, "{k}: {seen:?}");
    }
}

#[test]
fn both_directions_by_parameter_and_by_set_point() {
    for (reversed, wanted_rpm) in [(1.0, 2000.0), (0.0, -2000.0)] {
        let both = (ParamId::Inp3d, 1.0);
        let mut rig = rig(bench(), &[(ParamId::MotDir, reversed), both]);
        let setpoint = rpm(&rig, wanted_rpm);
        let seen = run(&mut rig, setpoint, 1.2);
        assert!((seen.rpm + 2000.0).abs() < 40.0, "{seen:?}");
        let reported = rig.config().scale.rpm(rig.snapshot().speed);
        assert!((reported - wanted_rpm).abs() < 40.0, "{reported}");
    }
}

#[test]
fn it_reverses_by_braking_and_starting_the_other_way() {
    let mut rig = rig(bench(), &[(ParamId::Inp3d, 1.0)]);
    let setpoint = rpm(&rig, 3000.0);
    run(&mut rig, setpoint, 1.0);
    let setpoint = rpm(&rig, -3000.0);
    let seen = run(&mut rig, setpoint, 2.0);
    assert!((seen.rpm + 3000.0).abs() < 60.0, "{seen:?}");
    assert!(rig.snapshot().faults.is_empty());
}

#[test]
fn the_current_stays_within_its_bound_in_steps() {
    let limit_a = 12.0;
    let mut rig = rig(bench(), &[(ParamId::LimPhaseA, limit_a)]);
    for wanted_rpm in [1000.0, 5500.0, 1500.0, 5000.0] {
        let setpoint = rpm(&rig, wanted_rpm);
        let seen = run(&mut rig, setpoint, 1.0);
        assert!(
            (seen.rpm / f64::from(wanted_rpm) - 1.0).abs() < 0.02,
            "{seen:?}"
        );
        // Ripple and the extra current of a commutation stay below the trip at 1.4 times.
        assert!(seen.most_a < 1.4 * f64::from(limit_a), "{seen:?}");
        assert!(seen.error_deg < 15.0, "{seen:?}");
    }
}

#[test]
fn voltage_and_current_are_held() {
    let mut rig = rig(bench(), &[]);
    let share = |x| Setpoint::Voltage(fixed::types::I1F31::from_num(x));
    let seen = run(&mut rig, share(0.6), 2.0);
    // 0.6·0.92 of 24 V less 2·R·i over 1.654·p·φ; the load takes some 3 A, the dead time 0.5 V.
    assert!((seen.rpm - 4300.0).abs() < 350.0, "{seen:?}");
    let current = Setpoint::Torque(rig.config().scale.current_from_a(3.0));
    run(&mut rig, current, 2.0);
    let i_q = rig.config().scale.amperes(rig.snapshot().i.q);
    // A six-step current of 3 A has a fundamental of 3.31 A, which varies over the sextant.
    assert!((i_q - 3.3).abs() < 0.6, "{i_q}");
}

#[test]
fn a_blocked_rotor_is_tried_a_few_times_and_then_a_fault() {
    let mut rig = rig(
        Bench {
            imposed_rad_s: Some(0.0),
            ..bench()
        },
        &[],
    );
    let setpoint = rpm(&rig, 1000.0);
    let seen = run(&mut rig, setpoint, 4.0);
    assert!(rig.snapshot().faults.contains(Fault::Stuck), "{seen:?}");
    assert!(seen.starts == 4, "{seen:?}");
    assert!(seen.most_a < 28.0, "{seen:?}");
}
