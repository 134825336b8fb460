//! Hall sensors that fail on the bench: in merged mode the flux crossings take over.

use siskin_control::build::build;
use siskin_control::drive::{Phase, Setpoint};
use siskin_emulator::fault::InForce;
use siskin_emulator::rig::{Bench, Rig};
use siskin_params::{BOSSO_BENCH, ParamId, Params};

/// Merged with the flux crossings.
const MERGED: [(ParamId, f32); 2] = [(ParamId::CtlObserver, 2.0), (ParamId::CtlHall, 1.0)];

fn rig(bench: Bench) -> Rig {
    let mut params = Params::of(&BOSSO_BENCH);
    for (id, value) in MERGED {
        params.set(id, value).expect("in range");
    }
    let board = bench.sensing.board(bench.delay);
    let config = build(&params, &board).expect("the parameters fit the bench");
    Rig::new(bench, config)
}

/// Sticks Hall sensors at a level from now on.
fn stick(rig: &mut Rig, hall: [Option<bool>; 3]) {
    let before = InForce::default();
    rig.disturb(&before, &InForce { hall, ..before });
}

/// One sensor stuck at a level.
fn one(phase: usize, level: bool) -> [Option<bool>; 3] {
    let mut stuck = [None; 3];
    stuck[phase] = Some(level);
    stuck
}

/// What a stretch of time at a speed showed.
#[derive(Debug, Default)]
struct Seen {
    /// Mean speed over the last tenth of a second.
    rpm: f64,
    least_rpm: f64,
    most_rpm: f64,
    /// Periods in Park.
    parked: u32,
    /// When a sensor was first reported faulty, s.
    fault_at_s: Option<f64>,
    /// Largest angle error in Run, degrees.
    error_deg: f64,
}

fn run(rig: &mut Rig, rpm: f32, time_s: f64) -> Seen {
    let setpoint = Setpoint::Speed(rig.config().scale.speed_from_rpm(rpm));
    let periods = (time_s / rig.period_s()) as u32;
    let tail = (0.1 / rig.period_s()) as u32;
    let mut seen = Seen {
        least_rpm: f64::INFINITY,
        ..Seen::default()
    };
    for k in 0..periods {
        let period = rig.period(setpoint);
        let snapshot = rig.snapshot();
        if periods - k <= tail {
            seen.rpm += period.rpm() / f64::from(tail);
        }
        seen.least_rpm = seen.least_rpm.min(period.rpm());
        seen.most_rpm = seen.most_rpm.max(period.rpm());
        seen.parked += u32::from(snapshot.phase == Phase::Park);
        if snapshot.sensor_fault && seen.fault_at_s.is_none() {
            seen.fault_at_s = Some(f64::from(k) * rig.period_s());
        }
        if snapshot.phase == Phase::Run {
            seen.error_deg = seen.error_deg.max(period.angle_error_deg(&snapshot).abs());
        }
    }
    seen
}

#[test]
fn a_sensor_that_breaks_while_it_runs_is_detected_and_survived() {
    for rpm in [1000.0_f32, 3000.0, 6000.0] {
        for phase in 0..3 {
            for level in [false, true] {
                let mut rig = rig(Bench::default());
                let before = run(&mut rig, rpm, 1.5);
                assert!(
                    (before.rpm / f64::from(rpm) - 1.0).abs() < 0.02,
                    "{before:?}"
                );
                assert_eq!(before.fault_at_s, None, "{before:?}");

                stick(&mut rig, one(phase, level));
                let after = run(&mut rig, rpm, 1.0);
                let case = format!("{rpm} rpm, {phase} {level}: {after:?}");
                // Two turns bring at least three contradictions, and the first turn begins anywhere.
                let three_turns_s = 3.0 * 60.0 / f64::from(rpm) / 12.0;
                assert!(
                    after.fault_at_s.is_some_and(|s| s < three_turns_s),
                    "{case}"
                );
                let apart = |rpm_seen: f64| (rpm_seen / f64::from(rpm) - 1.0).abs();
                assert!(apart(after.least_rpm) < 0.05, "{case}");
                assert!(apart(after.most_rpm) < 0.05, "{case}");
                assert!(after.error_deg < 30.0, "{case}");
                assert!(rig.snapshot().faults.is_empty(), "{case}");
                assert_eq!(after.parked, 0, "{case}");
            }
        }
    }
}

/// Merged sensors that fail before the start, or prove faulty in it, leave a sensorless start.
#[test]
fn a_sensor_broken_at_standstill_leaves_a_start_by_park_and_ramp() {
    let cable_off = [Some(true); 3];
    let mut cases = vec![cable_off];
    for phase in 0..3 {
        cases.extend([false, true].map(|level| one(phase, level)));
    }
    for hall_stuck in cases {
        for k in 0..6 {
            let mut rig = rig(Bench {
                initial_angle_turns: (f64::from(k) + 0.4) / 6.0,
                ..Bench::default()
            });
            stick(&mut rig, hall_stuck);
            let seen = run(&mut rig, 3000.0, 3.0);
            let case = format!("{hall_stuck:?}, {k}: {seen:?}");
            assert!(rig.snapshot().sensor_fault, "{case}");
            assert!((seen.rpm - 3000.0).abs() < 30.0, "{case}");
            assert!(rig.snapshot().faults.is_empty(), "{case}");
            if hall_stuck == cable_off {
                assert!(seen.parked > 0, "{case}");
            }
        }
    }
}

#[test]
fn a_second_start_finds_the_rotor_where_it_has_been_left() {
    for k in 0..12 {
        let mut rig = rig(Bench {
            initial_angle_turns: f64::from(k) / 12.0,
            ..Bench::default()
        });
        run(&mut rig, 1000.0, 0.5);
        // Braked and at rest, with the low sides on.
        for _ in 0..(2.0 / rig.period_s()) as u32 {
            rig.period(Setpoint::Zero);
        }
        let first = rig.snapshot().phase;
        assert_eq!(first, Phase::Brake);
        let again = run(&mut rig, 1000.0, 0.5);
        assert_eq!(again.parked, 0, "{k}: {again:?}");
        assert!((again.rpm - 1000.0).abs() < 20.0, "{k}: {again:?}");
        assert!(again.least_rpm > -10.0, "{k}: {again:?}");
    }
}
