//! What is recorded, what holds it, and what a reader makes of it.

use std::vec::Vec;

use siskin_params::{BOSSO_BENCH, Board, Params};

use super::*;
use crate::build::build;
use crate::drive::{Fault, Phase, Setpoint, step};

/// A drive at rest whose interrupt records what the tests say of its bridge.
struct Bench {
    config: Config,
    state: State,
    record: Record,
    period: u32,
}

impl Bench {
    fn new() -> Self {
        let config = build(&Params::of(&BOSSO_BENCH), &Board::BENCH).expect("the defaults fit");
        let bench = Self {
            state: State::new(&config),
            config,
            record: Record::new(),
            period: 0,
        };
        bench.record.open();
        bench
    }

    fn sample(number: u32) -> Sample {
        let counts = |counts: i32| AdcCounts::from_num(counts);
        let number = number as i32;
        Sample {
            currents: [counts(number), counts(-number), counts(-2048)],
            bus: counts(1400),
            terminals: [AdcCounts::ZERO; 3],
            hall: 7,
        }
    }

    /// Runs this many periods with this bridge; the readings count on.
    fn run(&mut self, periods: u32, bridge: Bridge) {
        for _ in 0..periods {
            self.period += 1;
            let sample = Self::sample(self.period);
            self.record
                .note(&self.config, &self.state, (&sample, &bridge), self.period);
        }
    }

    fn drive(&mut self, periods: u32) {
        let duties = [0.0, 0.25, 1.0].map(Duty::from_num);
        self.run(periods, Bridge::Duty(duties));
    }

    /// Starts, as far as that goes without a motor.
    fn turn(&mut self) {
        let speed = self.config.scale.speed_from_rpm(3000.0);
        let nothing = Sample {
            currents: [AdcCounts::ZERO; 3],
            ..Self::sample(0)
        };
        while !self.state.drives() {
            step(
                &self.config,
                &mut self.state,
                nothing,
                Setpoint::Speed(speed),
            );
            assert!(self.state.snapshot().faults.is_empty());
        }
    }

    fn trip(&mut self, fault: Fault) {
        let sample = Self::sample(0);
        let bridge = step(
            &self.config,
            &mut self.state,
            sample,
            Setpoint::Fault(fault),
        );
        assert_eq!(bridge, Bridge::Off);
        // The row of a trip is complete in the second period.
        self.run(2, bridge);
    }

    fn clear(&mut self) {
        for _ in 0..self.config.clear_periods + 10 {
            step(
                &self.config,
                &mut self.state,
                Self::sample(0),
                Setpoint::Zero,
            );
        }
        assert!(self.state.snapshot().faults.is_empty());
    }

    fn read(&self) -> Recorded {
        let mut file = Vec::new();
        let put = &mut |word: u32| file.extend(word.to_le_bytes());
        self.record.for_each_word(&Board::BENCH, 7.0, put);
        // A truncated file is refused or yields less; it never panics.
        for end in (0..file.len()).step_by(7) {
            let cut = Recorded::read(&file[..end]);
            assert!(cut.is_none() || end >= 4 * 7, "{end}");
        }
        Recorded::read(&file).expect("its own file")
    }
}

fn kinds(read: &Recorded) -> Vec<(u32, Fault)> {
    let faults = read.faults.iter();
    faults.map(|seen| (seen.number, seen.fault)).collect()
}

#[test]
fn the_periods_before_a_trip_and_that_of_the_trip_are_kept() {
    let mut bench = Bench::new();
    assert_eq!(bench.read(), Recorded::default());
    bench.drive(100);
    bench.trip(Fault::OverCurrent);
    bench.run(1000, Bridge::Off);
    let read = bench.read();
    assert_eq!(kinds(&read), [(1, Fault::OverCurrent)]);
    let seen = &read.faults[0];
    assert_eq!((seen.phase, seen.starts_ago), (Phase::Idle, 0));
    let period_s = bench.config.scale.period_s;
    // 100 driven periods, that of the trip, and the one that records it.
    assert!((seen.time_s - 102.0 * period_s).abs() < 1e-9);
    assert!((seen.bus_v - 1400.0 * Board::BENCH.bus_v_per_count).abs() < 1e-3);
    assert_eq!(read.holder, Some(1));
    assert_eq!(read.periods.len(), PERIODS);
    for (n, period) in read.periods.iter().enumerate() {
        let number = (101 - PERIODS + 1 + n) as f32;
        let a_per_count = Board::BENCH.current_a_per_count;
        let wanted = [number, -number, -2048.0].map(|counts| counts * a_per_count);
        assert_eq!(period.currents_a, wanted);
        let last = n + 1 == PERIODS;
        let duties = [0.0, 0.25, 1.0].map(|duty| (!last).then_some(duty));
        assert_eq!(period.duties, duties, "{n}");
        let ago = (n as f32 - PERIODS as f32) * period_s;
        assert!((period.time_s - ago).abs() < 1e-9);
    }
}

#[test]
fn the_first_trip_holds_its_periods_until_they_are_read_and_the_bridge_drives() {
    let mut bench = Bench::new();
    bench.drive(10);
    bench.trip(Fault::OverCurrent);
    let first = bench.read();
    assert_eq!(first.periods.len(), 11);
    bench.clear();
    bench.drive(200);
    bench.trip(Fault::OverVoltage);
    let read = bench.read();
    assert_eq!((read.holder, &read.periods), (Some(1), &first.periods));
    assert_eq!(read.faults.len(), 2, "noted all the same");

    bench.record.taken();
    bench.run(10, Bridge::Off);
    assert_eq!(bench.read().periods, first.periods, "may be read again");
    bench.clear();
    bench.drive(20);
    assert_eq!(bench.read().periods, first.periods, "a tune");
    bench.turn();
    bench.drive(20);
    assert_eq!(bench.read().holder, None);
    bench.trip(Fault::Stuck);
    let read = bench.read();
    // The first driven period freed them.
    assert_eq!((read.holder, read.periods.len()), (Some(3), 20));
}

#[test]
fn a_fault_at_rest_leaves_the_periods_alone() {
    let mut bench = Bench::new();
    bench.drive(10);
    bench.run(5, Bridge::Off);
    bench.trip(Fault::UnderVoltage);
    let read = bench.read();
    assert_eq!(kinds(&read), [(1, Fault::UnderVoltage)]);
    assert_eq!((read.holder, read.periods.len()), (None, 0));
}

#[test]
fn a_reset_leaves_it_and_power_up_does_not() {
    let mut bench = Bench::new();
    bench.drive(10);
    bench.trip(Fault::OverCurrent);
    let before = bench.read();
    bench.state = State::new(&bench.config);
    bench.record.open();
    bench.run(10, Bridge::Off);
    bench.trip(Fault::Stuck);
    let read = bench.read();
    assert_eq!(kinds(&read), [(1, Fault::OverCurrent), (2, Fault::Stuck)]);
    let ago: Vec<_> = read.faults.iter().map(|seen| seen.starts_ago).collect();
    assert_eq!(ago, [1, 0]);
    assert_eq!(read.periods, before.periods);

    for word in &bench.record.words {
        word.store(0x5555_aaaa, Relaxed);
    }
    bench.record.open();
    assert_eq!(bench.read(), Recorded::default());
}

#[test]
fn of_many_faults_the_last_are_kept() {
    let mut bench = Bench::new();
    for _ in 0..12 {
        bench.trip(Fault::Stuck);
        bench.clear();
    }
    let numbers: Vec<_> = kinds(&bench.read()).iter().map(|seen| seen.0).collect();
    assert_eq!(numbers, (5..=12).collect::<Vec<_>>());
}

#[test]
fn after_hours_of_driving_each_period_still_has_its_time() {
    let mut bench = Bench::new();
    bench.record.put(place::WRITTEN, 1 << 28);
    bench.drive(100);
    bench.trip(Fault::OverCurrent);
    let read = bench.read();
    assert_eq!(read.periods.len(), PERIODS);
    let period_s = bench.config.scale.period_s;
    for (n, period) in read.periods.iter().enumerate() {
        let ago = (n as f32 - PERIODS as f32) * period_s;
        assert!((period.time_s - ago).abs() < 1e-9, "{n}");
    }
}

/// A break right after a trip: the first is the one that holds the periods.
#[test]
fn two_faults_in_succession_are_two_rows() {
    let mut bench = Bench::new();
    bench.drive(100);
    for fault in [Fault::Overrun, Fault::OverCurrent] {
        let sample = Bench::sample(0);
        let bridge = step(
            &bench.config,
            &mut bench.state,
            sample,
            Setpoint::Fault(fault),
        );
        bench.run(1, bridge);
    }
    bench.run(10, Bridge::Off);
    let read = bench.read();
    assert_eq!(kinds(&read), [(1, Fault::Overrun), (2, Fault::OverCurrent)]);
    assert_eq!(read.holder, Some(1));
}
