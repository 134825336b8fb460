//! The drive's phases and faults on synthetic samples. Tests with a motor model cover how it turns
//! one.

use std::f64::consts::TAU;
use std::vec::Vec;

use siskin_params::{BOSSO_BENCH, Board, ParamId, Params};
use siskin_units::{AdcCounts, Current, Speed};

use super::*;
use crate::build::build;

mod any;
mod at_rest;
mod faults;
mod pull;
mod retries;
mod shunts;
mod starts;
mod tones;

const COUNTS_PER_A: f64 = 2048.0 / 40.0;

fn config_with(changes: &[(ParamId, f32)]) -> Config {
    let mut params = Params::of(&BOSSO_BENCH);
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

/// Returns the open-terminal readings of a turning rotor: its back-EMF, on top of the lowest
/// phase's diode drop where that diode conducts.
fn terminals(turns: f64, rpm: f64) -> [AdcCounts; 3] {
    let peak_v = 1.3e-3 * rpm * 12.0 * TAU / 60.0;
    let emf = [0.0, 1.0, 2.0].map(|phase: f64| -peak_v * (TAU * (turns - phase / 3.0)).sin());
    let lowest = emf.into_iter().fold(f64::INFINITY, f64::min);
    let lift = (-lowest - 0.7).max(0.0);
    emf.map(|e| AdcCounts::from_num(((e + lift) * 4096.0 / 70.0).round().max(0.0)))
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

    /// Runs periods without current at 24 V.
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

    /// Returns the phases in this many periods without current, each with its length.
    fn phases(&mut self, periods: u32, setpoint: Setpoint) -> Vec<(Phase, u32)> {
        let mut phases: Vec<(Phase, u32)> = Vec::new();
        for _ in 0..periods {
            self.quiet(1, setpoint);
            let now = self.phase();
            match phases.last_mut() {
                Some((phase, length)) if *phase == now => *length += 1,
                _ => phases.push((now, 1)),
            }
        }
        phases
    }

    /// Runs periods without current until a phase begins; returns their number.
    fn until(&mut self, phase: Phase, setpoint: Setpoint) -> u32 {
        for periods in 1..=100_000 {
            self.quiet(1, setpoint);
            if self.phase() == phase {
                return periods;
            }
        }
        panic!("no {phase:?}, but {:?}", self.phase());
    }

    /// Returns the phase in which a drive begins from rest.
    fn beginning(&self) -> Phase {
        match self.config.six_step {
            Some(_) => Phase::Ramp,
            None => Phase::Park,
        }
    }

    fn periods(&self, seconds: f32) -> u32 {
        (seconds / self.config.scale.period_s) as u32
    }

    fn turn(&self) -> Setpoint {
        Setpoint::Speed(self.config.scale.speed_from_rpm(3000.0))
    }

    fn faults(&self) -> Faults {
        self.state.snapshot().faults
    }

    /// Clears the faults at once.
    fn clear_faults(&mut self) {
        self.state.shared.latch.faults = Faults::NONE;
        self.state.shared.failed_starts = 0;
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
fn over_current_needs_two_samples_in_a_row_and_latches_until_stop() {
    let mut bench = Bench::new(&[]);
    let turn = bench.turn();
    // The trip is at 1.4 times 20 A.
    let below = sample([27.9, -14.0, -13.9], 24.0);
    let above = sample([-14.0, -14.1, 28.1], 24.0);
    bench.until(Phase::Park, turn);
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
    bench.until(Phase::Park, turn);
    assert_eq!(bench.state.snapshot().fault_count, 1);
}

#[test]
fn the_supply_is_watched_at_both_ends_and_stop_does_not_end_a_fault_that_lasts() {
    for (bus_v, fault) in [(8.5, Fault::UnderVoltage), (30.5, Fault::OverVoltage)] {
        let mut bench = Bench::new(&[]);
        let turn = bench.turn();
        bench.quiet(100, turn);
        // The filter takes an eighth per period.
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
