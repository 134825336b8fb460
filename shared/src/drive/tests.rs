//! The drive's phases and faults, with samples that a test makes up. How it turns a motor is
//! tested where there is one.

use std::vec;

use super::*;
use crate::params::{Board, ParamId, Params, build};

const COUNTS_PER_A: f64 = 2048.0 / 40.0;

fn config_with(changes: &[(ParamId, f32)]) -> Config {
    let mut params = Params::default();
    for (id, value) in changes {
        params.set(*id, *value).expect("in range");
    }
    build(&params, &Board::BENCH).expect("it makes a drive")
}

fn sample(currents_a: [f64; 3], bus_v: f64) -> Sample {
    Sample {
        currents: currents_a.map(|a| AdcCounts::from_num(a * COUNTS_PER_A)),
        bus: AdcCounts::from_num(bus_v * 4096.0 / 70.0),
        terminals: [AdcCounts::ZERO; 3],
        hall: 7,
    }
}

struct Bench {
    config: Config,
    state: State,
}

impl Bench {
    fn new(changes: &[(ParamId, f32)]) -> Self {
        let config = config_with(changes);
        let state = State::new(&config);
        Self { config, state }
    }

    /// Periods with no current at 24 V.
    fn quiet(&mut self, periods: u32, setpoint: Setpoint) -> Bridge {
        self.run(periods, sample([0.0; 3], 24.0), setpoint)
    }

    fn run(&mut self, periods: u32, sample: Sample, setpoint: Setpoint) -> Bridge {
        let mut bridge = Bridge::Off;
        for _ in 0..periods {
            bridge = step(&self.config, &mut self.state, sample, setpoint);
        }
        bridge
    }

    fn turn(&self) -> Setpoint {
        Setpoint::Speed(self.config.scale.speed_from_rpm(3000.0))
    }

    fn faults(&self) -> Faults {
        self.state.snapshot().faults
    }

    fn phase(&self) -> Phase {
        self.state.snapshot().phase
    }
}

#[test]
fn nothing_switches_without_a_setpoint() {
    let mut bench = Bench::new(&[]);
    assert_eq!(bench.quiet(10_000, Setpoint::Stop), Bridge::Off);
    assert_eq!(bench.phase(), Phase::Idle);
}

#[test]
fn a_start_parks_then_ramps_and_begins_again_when_the_rotor_does_not_follow() {
    let mut bench = Bench::new(&[]);
    let turn = bench.turn();
    assert!(matches!(bench.quiet(1, turn), Bridge::Duty(_)));
    assert_eq!(bench.phase(), Phase::Park);
    // 0.4 As at 4 A are 0.1 s.
    bench.quiet(2390, turn);
    assert_eq!(bench.phase(), Phase::Park);
    bench.quiet(20, turn);
    assert_eq!(bench.phase(), Phase::Ramp);
    // 300 rpm at 800 rpm/s are 0.375 s; no current flows, so there is no back-EMF either.
    let phases: vec::Vec<Phase> = (0..9100)
        .map(|_| {
            bench.quiet(1, turn);
            bench.phase()
        })
        .collect();
    assert!(!phases.contains(&Phase::Run));
    assert_eq!(phases.last(), Some(&Phase::Park));
}

#[test]
fn stop_ends_a_start_at_once() {
    let mut bench = Bench::new(&[]);
    let turn = bench.turn();
    bench.quiet(5000, turn);
    assert_eq!(bench.phase(), Phase::Ramp);
    assert_eq!(bench.quiet(1, Setpoint::Stop), Bridge::Brake);
    let mut bench = Bench::new(&[(ParamId::MotStop, 0.0)]);
    bench.quiet(5000, turn);
    assert_eq!(bench.quiet(1, Setpoint::Stop), Bridge::Off);
}

#[test]
fn over_current_needs_two_samples_in_a_row_and_latches_until_stop() {
    let mut bench = Bench::new(&[]);
    let turn = bench.turn();
    // The trip is at 1.4 times 20 A.
    let below = sample([27.9, -14.0, -13.9], 24.0);
    let above = sample([-14.0, -14.1, 28.1], 24.0);
    bench.quiet(10, turn);
    bench.run(100, below, turn);
    bench.run(1, above, turn);
    bench.quiet(1, turn);
    bench.run(1, above, turn);
    assert!(bench.faults().is_empty());
    assert_eq!(bench.run(1, above, turn), Bridge::Off);
    assert!(bench.faults().contains(Fault::OverCurrent));
    assert_eq!(bench.quiet(1000, turn), Bridge::Off);
    assert!(bench.faults().contains(Fault::OverCurrent));
    // 0.3 s.
    bench.quiet(20_000, Setpoint::Stop);
    assert!(bench.faults().contains(Fault::OverCurrent));
    bench.quiet(7190, Setpoint::Zero);
    assert!(bench.faults().contains(Fault::OverCurrent));
    bench.quiet(20, Setpoint::Zero);
    assert!(bench.faults().is_empty());
    assert!(matches!(bench.quiet(1, turn), Bridge::Duty(_)));
    assert_eq!(bench.state.snapshot().fault_count, 1);
}

#[test]
fn the_supply_is_watched_at_both_ends_and_stop_does_not_end_a_fault_that_lasts() {
    for (bus_v, fault) in [(8.5, Fault::UnderVoltage), (30.5, Fault::OverVoltage)] {
        let mut bench = Bench::new(&[]);
        let turn = bench.turn();
        bench.quiet(100, turn);
        // The filter takes an eighth a period.
        assert_eq!(bench.run(60, sample([0.0; 3], bus_v), turn), Bridge::Off);
        assert!(bench.faults().contains(fault), "{fault:?}");
        bench.run(10_000, sample([0.0; 3], bus_v), Setpoint::Zero);
        assert!(bench.faults().contains(fault), "{fault:?}");
        bench.quiet(7300, Setpoint::Zero);
        assert!(bench.faults().is_empty(), "{fault:?}");
        assert_eq!(bench.state.snapshot().fault_count, 1);
    }
}

#[test]
fn a_fault_from_outside_holds_until_stop() {
    let mut bench = Bench::new(&[]);
    let turn = bench.turn();
    bench.quiet(100, turn);
    let hot = Setpoint::Fault(Fault::OverTemperature);
    assert_eq!(bench.quiet(10, hot), Bridge::Off);
    assert_eq!(bench.quiet(10, turn), Bridge::Off);
    assert!(bench.faults().contains(Fault::OverTemperature));
    bench.quiet(7300, Setpoint::Zero);
    assert!(bench.faults().is_empty());
}

#[test]
fn reversed_is_two_phases_swapped() {
    let mut normal = Bench::new(&[]);
    let mut reversed = Bench::new(&[(ParamId::MotDir, 1.0)]);
    let turn = normal.turn();
    for _ in 0..3000 {
        let a = normal.run(1, sample([1.0, -0.7, -0.3], 24.0), turn);
        let b = reversed.run(1, sample([1.0, -0.3, -0.7], 24.0), turn);
        let (Bridge::Duty([a, b, c]), Bridge::Duty(swapped)) = (a, b) else {
            panic!("both switch");
        };
        assert_eq!([a, c, b], swapped);
    }
}

#[test]
fn a_test_starts_with_no_more_than_its_bound() {
    // A fifth of 10 A, where the ramp's current is 4 A.
    let mut bench = Bench::new(&[(ParamId::LimPhaseA, 10.0)]);
    let test = Setpoint::Test(bench.config.scale.current_from_a(0.5));
    // At half of the ramp's current Park takes twice its 0.1 s.
    bench.quiet(4750, test);
    assert_eq!(bench.phase(), Phase::Park);
    bench.quiet(100, test);
    assert_eq!(bench.phase(), Phase::Ramp);
}

#[test]
fn only_a_current_above_zero_starts() {
    let mut bench = Bench::new(&[]);
    for amperes in [0.0, -3.0] {
        let current = bench.config.scale.current_from_a(amperes);
        for setpoint in [Setpoint::Torque(current), Setpoint::Test(current)] {
            assert_eq!(bench.quiet(100, setpoint), Bridge::Off);
        }
    }
    let current = bench.config.scale.current_from_a(0.1);
    assert!(matches!(
        bench.quiet(1, Setpoint::Torque(current)),
        Bridge::Duty(_)
    ));
}

#[test]
fn an_unseen_shaft_is_reported_until_it_has_had_time_to_stop() {
    for changes in [
        vec![],
        vec![
            (ParamId::PwmFreqHz, 60_000.0),
            (ParamId::PwmDeadtimeNs, 100.0),
            (ParamId::MotPolePairs, 1.0),
        ],
    ] {
        let mut bench = Bench::new(&changes);
        let turn = bench.turn();
        let speed = bench.config.scale.speed_from_rpm(3000.0);
        bench.state.phase = Phase::Run;
        bench.state.seen.speed = speed;
        bench.quiet(1, Setpoint::Fault(Fault::OverTemperature));
        let rpm = bench.config.scale.rpm(bench.state.snapshot().speed);
        assert!((rpm - 3000.0).abs() < 1.0, "{rpm}");
        // Zero throttle ends the fault after 0.3 s, but a rotor at that speed is not parked.
        let period_s = bench.config.scale.period_s;
        let periods = |s: f32| (s / period_s) as u32;
        bench.quiet(periods(0.5), Setpoint::Zero);
        assert!(bench.faults().is_empty());
        assert_eq!(bench.quiet(1, turn), Bridge::Off);
        bench.quiet(periods(30.0), Setpoint::Zero);
        assert_eq!(bench.state.snapshot().speed, Speed::ZERO);
        assert!(matches!(bench.quiet(1, turn), Bridge::Duty(_)));
    }
}

#[test]
fn no_sample_makes_it_overflow() {
    // Overflow panics in this build.
    let mut bench = Bench::new(&[(ParamId::LimPhaseA, 27.0), (ParamId::LimBusVMax, 60.0)]);
    let turn = bench.turn();
    let mut noise = 1_u32;
    for period in 0..200_000_u32 {
        let mut reading = || {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            AdcCounts::from_num((noise >> 20) as i32 - 2048)
        };
        let sample = Sample {
            currents: [reading(), reading(), reading()].map(|i| i / 2),
            bus: reading().abs() * 2,
            terminals: [reading(), reading(), reading()].map(|v| v.abs() * 2),
            hall: period as u8 & 7,
        };
        let setpoint = if period % 7 == 0 {
            Setpoint::Stop
        } else {
            turn
        };
        step(&bench.config, &mut bench.state, sample, setpoint);
        if period % 1000 == 999 {
            bench.quiet(20_000, turn);
        }
    }
}
