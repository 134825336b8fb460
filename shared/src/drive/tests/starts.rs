//! Starts: sequence, attempts and directions.

use siskin_units::Angle;

use super::*;
use crate::control::observer::sector::Sector;
use crate::drive::config::QUICK_ATTEMPTS;
use crate::drive::foc::begin::PREPARATION_PERIODS;
use crate::drive::schedule::CYCLE;
use fixed::types::I1F31;

#[test]
fn a_start_senses_charges_parks_and_ramps() {
    let mut bench = Bench::new(&[]);
    let turn = bench.turn();
    let phases = bench.phases(8000, turn);
    let pulses = bench.config.charge.periods;
    let swing_rad_s = (1.5 * 12.0 * 12.0 * 1.3e-3 * 4.0 / 1.43e-4_f64).sqrt();
    let [
        (Phase::Sense, sense),
        (Phase::Charge, charge),
        (Phase::Park, park),
        (Phase::Ramp, _),
    ] = phases[..]
    else {
        panic!("{phases:?}");
    };
    // 5 ms are 128 periods, rounded to a power of two; two before them let the current decay, and
    // one after them judges the readings.
    assert_eq!(sense, 2 + 128 + 1);
    assert_eq!(charge, pulses + PREPARATION_PERIODS);
    // Three periods of the rotor's swing, more than 0.4 As at 4 A, in steps of eight, and eight for
    // the observer.
    let expected = 3.0 * TAU / swing_rad_s * 24_000.0;
    assert!(
        (f64::from(park) - expected - 8.0).abs() < 8.0,
        "{park}, {expected}"
    );
}

#[test]
fn nothing_switches_before_park_and_after_the_end() {
    let mut bench = Bench::new(&[]);
    let turn = bench.turn();
    for period in 0..120_000 {
        let setpoint = if period % 10_007 < 3 {
            Setpoint::Stop
        } else {
            turn
        };
        let bridge = bench.quiet(1, setpoint);
        let allowed = match bench.phase() {
            Phase::Idle | Phase::Sense => bridge == Bridge::Off,
            Phase::Charge => bridge == Bridge::Charge(bench.config.charge.duty),
            Phase::Brake => bridge == Bridge::Brake,
            Phase::Park | Phase::Ramp | Phase::Run | Phase::Stopping | Phase::Tone => {
                matches!(bridge, Bridge::Duty(_))
            }
        };
        assert!(allowed, "{period}: {:?} {bridge:?}", bench.phase());
    }
}

#[test]
fn a_start_that_fails_is_tried_again_with_more_current_and_ends_as_stuck() {
    for observer in [0.0, 1.0, 3.0] {
        let mut bench = Bench::new(&[(ParamId::CtlObserver, observer)]);
        let turn = bench.turn();
        let scale = bench.config.scale;
        let mut ramps = 0;
        let mut before = Phase::Idle;
        let mut currents = Vec::new();
        for _ in 0..bench.periods(30.0) {
            bench.quiet(1, turn);
            let phase = bench.phase();
            assert_ne!(phase, Phase::Run, "{observer}: nothing has turned");
            if phase == Phase::Ramp && before != phase {
                ramps += 1;
                let attempt =
                    &bench.config.start[1 + usize::from(bench.state.shared.failed_starts)];
                currents.push(scale.amperes(attempt.current));
            }
            before = phase;
            if !bench.faults().is_empty() {
                break;
            }
        }
        assert!(bench.faults().contains(Fault::Stuck), "{observer}");
        assert_eq!(ramps, ATTEMPTS, "{observer}");
        // Half more each time.
        for (current, wanted) in currents.iter().zip([4.0, 6.0, 9.0, 13.5]) {
            assert!((current - wanted).abs() < 1e-3, "{currents:?}");
        }
        // Zero throttle restores all attempts.
        bench.quiet(bench.periods(0.32), Setpoint::Zero);
        assert!(bench.faults().is_empty());
        assert_eq!(bench.state.shared.failed_starts, 0);
    }
}

#[test]
fn a_motor_that_has_turned_in_this_flight_is_first_tried_by_quick_attempts() {
    let mut bench = Bench::new(&[]);
    let turn = bench.turn();
    bench.state.shared.latch.quick_attempts = QUICK_ATTEMPTS;
    let mut lengths = Vec::new();
    let mut parked = 0;
    while bench.faults().is_empty() {
        bench.quiet(1, turn);
        match bench.phase() {
            Phase::Park => parked += 1,
            Phase::Ramp if parked > 0 => lengths.push(core::mem::take(&mut parked)),
            _ => {}
        }
    }
    assert!(bench.faults().contains(Fault::Stuck));
    // Four times the current: swings of half the length. The first attempt of a start is left out.
    let quick = usize::from(QUICK_ATTEMPTS);
    assert_eq!(lengths.len(), quick + ATTEMPTS - 1);
    let seconds = |n: usize| lengths[n] as f32 * bench.config.scale.period_s;
    for n in [0, quick - 1] {
        assert!((seconds(n) - 0.106).abs() < 1e-3, "{}", seconds(n));
    }
    assert!((seconds(quick) - 0.550).abs() < 1e-3, "{}", seconds(quick));
}

#[test]
fn zero_throttle_ends_the_quick_attempts() {
    for stopped in [Setpoint::Zero, Setpoint::Stop] {
        let mut bench = Bench::new(&[]);
        bench.state.shared.latch.quick_attempts = QUICK_ATTEMPTS;
        bench.quiet(2, stopped);
        assert_eq!(bench.state.shared.latch.quick_attempts, 0);
    }
}

#[test]
fn zero_throttle_between_two_attempts_begins_with_the_first_one() {
    let mut bench = Bench::new(&[]);
    let turn = bench.turn();
    while bench.state.shared.failed_starts == 0 {
        bench.quiet(1, turn);
    }
    bench.quiet(2, Setpoint::Stop);
    assert_eq!(bench.state.shared.failed_starts, 0);
}

#[test]
fn a_start_the_other_way_begins_with_the_first_attempt() {
    for drive in [0.0, 1.0] {
        // A speed that gives six-step enough periods per sextant.
        let drives = [(ParamId::CtlDrive, drive), (ParamId::CtlRpmMax, 4500.0)];
        let mut bench = Bench::new(&[&drives[..], &[(ParamId::Inp3d, 1.0)]].concat());
        let turn = bench.turn();
        bench.until(bench.beginning(), turn);
        bench.state.shared.failed_starts = 1;
        bench.quiet(CYCLE, turn);
        assert_eq!(bench.state.shared.failed_starts, 1);
        bench.quiet(CYCLE, turn.mirrored());
        assert_eq!(bench.state.shared.failed_starts, 0, "{drive}");
    }
}

#[test]
fn stop_ends_a_start_at_once() {
    for (stop, bridge) in [(1.0, Bridge::Brake), (0.0, Bridge::Off)] {
        for phase in [Phase::Sense, Phase::Charge, Phase::Park, Phase::Ramp] {
            let mut bench = Bench::new(&[(ParamId::MotStop, stop)]);
            let turn = bench.turn();
            bench.until(phase, turn);
            // Before Park the rotor may turn at any speed.
            let parked = matches!(phase, Phase::Park | Phase::Ramp);
            let bridge = if parked { bridge } else { Bridge::Off };
            assert_eq!(bench.quiet(1, Setpoint::Stop), bridge);
            assert_eq!(bench.state.snapshot().speed, Speed::ZERO);
        }
    }
}

#[test]
fn reversed_is_two_phases_swapped() {
    let mut normal = Bench::new(&[]);
    let mut reversed = Bench::new(&[(ParamId::MotDir, 1.0)]);
    let turn = normal.turn();
    normal.until(Phase::Park, turn);
    reversed.until(Phase::Park, turn);
    for _ in 0..3000 {
        let a = normal.run(1, sample([1.0, -0.7, -0.3], 24.0), turn);
        let b = reversed.run(1, sample([1.0, -0.3, -0.7], 24.0), turn);
        let (Bridge::Duty([a, b, c]), Bridge::Duty(swapped)) = (a, b) else {
            panic!("both switch");
        };
        // Products round towards minus infinity, mirrored ones the other way.
        for (duty, swapped) in [a, c, b].into_iter().zip(swapped) {
            let off = duty.to_num::<f64>() - swapped.to_num::<f64>();
            assert!(off.abs() < 2e-6, "{off}");
        }
    }
}

#[test]
fn a_test_starts_with_no_more_than_its_bound() {
    // A fifth of 10 A, where the ramp's current is 4 A.
    let mut bench = Bench::new(&[(ParamId::LimPhaseA, 10.0)]);
    let turn = bench.turn();
    bench.until(Phase::Park, turn);
    let full = bench.until(Phase::Ramp, turn);
    bench.quiet(2, Setpoint::Stop);
    let test = Setpoint::Test(bench.config.scale.current_from_a(0.5));
    bench.until(Phase::Park, test);
    // At half the ramp's current Park takes twice as long.
    let half = bench.until(Phase::Ramp, test);
    assert!(half.abs_diff(2 * full) < 20, "{half}, {full}");
}

/// Returns set-points of one sign, of every kind that has one.
fn signed(bench: &Bench, sign: f32) -> [Setpoint; 3] {
    [
        Setpoint::Speed(bench.config.scale.speed_from_rpm(sign * 2000.0)),
        Setpoint::Torque(bench.config.scale.current_from_a(sign * 3.0)),
        Setpoint::Voltage(I1F31::from_num(sign * 0.25)),
    ]
}

#[test]
fn a_start_backwards_takes_both_directions_or_a_test() {
    for both in [0.0, 1.0] {
        for (sign, starts) in [(1.0, true), (0.0, false), (-1.0, both == 1.0)] {
            for setpoint in signed(&Bench::new(&[]), sign) {
                let mut bench = Bench::new(&[(ParamId::Inp3d, both)]);
                bench.quiet(200, setpoint);
                let case = std::format!("{both}: {setpoint:?}");
                assert_eq!(bench.phase() == Phase::Park, starts, "{case}");
                assert_eq!(bench.state.shared.reversed, starts && sign < 0.0, "{case}");
            }
        }
        for (amperes, starts) in [(0.5, true), (0.0, false), (-0.5, true)] {
            let mut bench = Bench::new(&[(ParamId::Inp3d, both)]);
            let test = Setpoint::Test(bench.config.scale.current_from_a(amperes));
            bench.quiet(200, test);
            assert_eq!(bench.phase() == Phase::Park, starts, "{amperes}");
            assert_eq!(bench.state.shared.reversed, amperes < 0.0);
        }
    }
}

#[test]
fn the_other_direction_ends_a_start() {
    let mut bench = Bench::new(&[(ParamId::Inp3d, 1.0)]);
    let [forwards, ..] = signed(&bench, 1.0);
    let [backwards, ..] = signed(&bench, -1.0);
    bench.until(Phase::Ramp, forwards);
    let mut bridges = (0..CYCLE).map(|_| bench.quiet(1, backwards));
    let ended = bridges.find(|bridge| !matches!(bridge, Bridge::Duty(_)));
    assert_eq!(ended, Some(Bridge::Brake));
    bench.until(Phase::Ramp, backwards);
    assert!(bench.state.shared.reversed);
    let snapshot = bench.state.snapshot();
    assert!(snapshot.speed <= Speed::ZERO);
}

/// A blocked rotor with Hall sensors.
fn blocked(changes: &[(ParamId, f32)], sector_deg: f64) -> (Bench, Sample) {
    let changes: Vec<_> = changes
        .iter()
        .copied()
        .chain([(ParamId::CtlObserver, 2.0)])
        .collect();
    let sample = Sample {
        hall: Sector::of(Angle::wrapping_from_num(sector_deg / 360.0)).code(),
        ..sample([0.0; 3], 24.0)
    };
    (Bench::new(&changes), sample)
}

#[test]
fn with_hall_sensors_a_start_needs_no_park() {
    for hall in [0.0, 1.0] {
        for degrees in [0.0, 60.0, 120.0, 180.0, 240.0, 300.0] {
            let (mut bench, sample) = blocked(&[(ParamId::CtlHall, hall)], degrees);
            let turn = bench.turn();
            bench.run(200, sample, turn);
            assert_eq!(bench.phase(), Phase::Run, "{degrees}");
            let angle = bench.state.snapshot().angle.to_num::<f64>();
            let error = (angle - degrees / 360.0 + 0.5).rem_euclid(1.0) - 0.5;
            assert!(error.abs() < 1e-6, "{degrees}: {angle}");
        }
    }
}

#[test]
fn with_hall_sensors_a_blocked_rotor_is_stuck_after_a_second_an_attempt() {
    for hall in [0.0, 1.0] {
        let (mut bench, sample) = blocked(&[(ParamId::CtlHall, hall)], 60.0);
        let turn = bench.turn();
        let mut periods = 0;
        let mut runs = 0;
        while bench.faults().is_empty() {
            let before = bench.phase();
            bench.run(1, sample, turn);
            assert!(!matches!(bench.phase(), Phase::Park | Phase::Ramp));
            runs += usize::from(bench.phase() == Phase::Run && before != Phase::Run);
            periods += 1;
            assert!(periods < bench.periods(ATTEMPTS as f32), "{runs}");
        }
        assert!(bench.faults().contains(Fault::Stuck));
        assert_eq!(runs, ATTEMPTS);
    }
}

#[test]
fn without_hall_sensors_the_merged_observer_starts_as_without_any() {
    // The pull-ups of unconnected sensors read 7.
    let mut bench = Bench::new(&[(ParamId::CtlObserver, 2.0)]);
    let turn = bench.turn();
    let course: Vec<Phase> = bench.phases(8000, turn).iter().map(|p| p.0).collect();
    let parked = [Phase::Sense, Phase::Charge, Phase::Park, Phase::Ramp];
    assert_eq!(course, parked);
    assert!(bench.state.snapshot().sensor_fault);
}

#[test]
fn hall_sensors_that_fail_at_standstill_are_done_without_after_a_tenth_of_a_second() {
    let (mut bench, sample) = blocked(&[], 60.0);
    let turn = bench.turn();
    bench.run(200, sample, turn);
    assert_eq!(bench.phase(), Phase::Run);
    // 0.1 s until the observer counts as lost, plus 5 ms for the next start.
    let periods = bench.until(Phase::Park, turn);
    assert!(periods < bench.periods(0.12), "{periods}");
    assert!(bench.state.snapshot().sensor_fault);
    bench.until(Phase::Ramp, turn);
}

#[test]
fn a_torque_against_the_rotation_does_not_turn_the_motor_round_within_run() {
    for setpoint in [Setpoint::Torque, Setpoint::Test] {
        let (mut bench, sample) = blocked(&[], 60.0);
        let current = |a| bench.config.scale.current_from_a(a);
        let (forwards, backwards) = (setpoint(current(1.0)), setpoint(current(-1.0)));
        bench.run(200, sample, forwards);
        assert_eq!(bench.phase(), Phase::Run);
        // One cycle until the set-point is checked, one until the rotor is.
        let bridge = bench.run(2 * CYCLE, sample, backwards);
        assert!(
            !matches!(bridge, Bridge::Duty(_)),
            "{backwards:?}: {bridge:?}"
        );
        if matches!(backwards, Setpoint::Torque(_)) {
            bench.run(20_000, sample, backwards);
            assert_eq!(bench.phase(), Phase::Brake);
            assert!(bench.faults().is_empty());
        }
    }
}

#[test]
fn what_the_last_run_held_is_forgotten_by_the_next_start() {
    let mut bench = Bench::new(&[]);
    let turn = bench.turn();
    bench.until(Phase::Park, turn);
    // The bounds of the speed regulator's current grow from it.
    bench.state.foc.loops.torque.i_q = Current::ONE;
    bench.quiet(CYCLE, Setpoint::Stop);
    assert_eq!(bench.state.foc.loops.torque.i_q, Current::ZERO);
}

#[test]
fn what_flows_as_the_bridge_is_turned_off_is_no_offset() {
    let mut bench = Bench::new(&[]);
    let turn = bench.turn();
    bench.run(2, sample([13.5, 0.0, -13.5], 24.0), turn);
    bench.until(Phase::Charge, turn);
    assert_eq!(bench.state.shared.zeros.offsets, [AdcCounts::ZERO; 3]);
}
