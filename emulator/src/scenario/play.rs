//! One run of a scenario.

use std::cell::Cell;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use siskin_control::drive::Setpoint;
use siskin_params::Params;
use siskin_units::Scale;

use super::error::ScenarioError;
use super::file::{RUN, Scenario, WindowTable};
use super::judge::{Verdict, judge};
use super::signal::{Demand, Signal, demand};
use crate::device::{Device, Start};
use crate::machine::Machine;
use crate::record::Recorder;
use crate::rig::Rig;
use crate::summary::{Report, Summary};
use crate::watch::{Watch, WatchError};

/// Most entries of one kind: signals, faults, windows or expectations. Some searches through them take quadratic time.
const ENTRIES_MAX: usize = 10_000;

/// The result of a run.
pub(super) struct Played {
    pub(super) report: Report,
    /// The results of the expectations.
    pub(super) verdicts: Vec<Verdict>,
    /// It was stopped before its end.
    pub(super) interrupted: bool,
}

/// Plays a scenario on the emulator's own ESC, to its end or until `stop` is set.
pub(super) fn play(
    scenario: &Scenario,
    record: Option<&Path>,
    stop: &AtomicBool,
) -> Result<Played, ScenarioError> {
    let signals = &scenario.signal;
    let last = Cell::new((None, None));
    let start = |start| Ok(Device::start(start)?);
    let played = run(scenario, record, stop, start, |device, until_ns, watch| {
        let imposed = |t_s, rig: &Rig| past_the_wire(signals, t_s, rig, &last);
        device.advance(until_ns, imposed, watch, &mut |_| {});
        Ok(())
    });
    played.map(|(played, _)| played)
}

/// Plays a scenario on another machine, driven only over its wire, as [`play`] does.
pub(super) fn play_on<M: Machine>(
    scenario: &Scenario,
    record: Option<&Path>,
    stop: &AtomicBool,
    start: impl FnOnce(Start) -> Result<(M, Option<&'static str>), ScenarioError>,
    ended: impl FnOnce(M),
) -> Result<Played, ScenarioError> {
    let signals = &scenario.signal;
    for (index, signal) in signals.iter().enumerate() {
        if !matches!(demand(signals, signal.at_s), Some(Demand::Throttle(_))) {
            let problem = "goes past the wire, which only the emulator can; give throttle";
            return Err(ScenarioError::of_key(format!("signal.{index}"), problem));
        }
    }
    let (played, machine) = run(
        scenario,
        record,
        stop,
        start,
        |machine: &mut M, until_ns, watch| Ok(machine.advance(until_ns, watch, &mut |_| {})?),
    )?;
    ended(machine);
    Ok(played)
}

/// Plays a scenario on what `start` makes, with the wire's frames on time.
fn run<M: Machine>(
    scenario: &Scenario,
    record: Option<&Path>,
    stop: &AtomicBool,
    start: impl FnOnce(Start) -> Result<(M, Option<&'static str>), ScenarioError>,
    mut advance: impl FnMut(&mut M, u64, &mut Watch) -> Result<(), ScenarioError>,
) -> Result<(Played, M), ScenarioError> {
    let overrides = scenario.params()?;
    let mut params = Params::default();
    for (id, value) in &overrides {
        // The scenario's own are in range.
        let _ = params.set(*id, *value);
    }
    let recorder = record.map(Recorder::create).transpose();
    let recorder = recorder.map_err(WatchError::Record)?;
    let mut watch = Watch::new(windows(scenario), recorder);
    let (mut machine, _) = start(Start {
        bench: scenario.bench.bench()?,
        overrides,
        // What is known of the motor is up to the scenario.
        defaults: Vec::new(),
        faults: scenario.faults()?,
        ..Start::default()
    })?;

    let began = Instant::now();
    let wire = scenario.bench.wire;
    let end_ns = (scenario.bench.duration_s * 1e9) as u64;
    let mut slice_ns = 0;
    let mut interrupted = false;
    while slice_ns < end_ns && !watch.failed() && !interrupted {
        let demand = demand(&scenario.signal, slice_ns as f64 * 1e-9);
        if let Some(Demand::Throttle(throttle)) = demand {
            let datagram = wire.datagram(throttle, &params);
            // The longest pulse and its rest take 2.34 of 2.5 ms: there is room.
            let _ = machine.wire(0).play(slice_ns, &datagram);
        }
        slice_ns += wire.interval_ns();
        advance(&mut machine, slice_ns.min(end_ns), &mut watch)?;
        interrupted = stop.load(Ordering::Relaxed) && slice_ns < end_ns;
    }
    let sim_s = machine.now_ns() as f64 * 1e-9;
    let report = watch.finish(sim_s, began.elapsed().as_secs_f64())?;
    let expectations = scenario.expect.iter();
    let verdicts = expectations.map(|expected| judge(expected, &report));
    let mut verdicts = verdicts.collect::<Result<Vec<_>, _>>()?;
    if interrupted {
        // A window still open has not been seen in full.
        let whole = |name: &str| {
            let mut windows = scenario.window.iter();
            windows.any(|window| window.name == name && window.t1_s <= sim_s)
        };
        let cut = verdicts.iter_mut().filter(|v| !whole(&v.window));
        cut.for_each(|verdict| verdict.held = None);
    }
    let played = Played {
        report,
        verdicts,
        interrupted,
    };
    Ok((played, machine))
}

/// Finds errors in a scenario before it is played, so that a mistake does not cost its run time.
pub(super) fn check(scenario: &Scenario) -> Result<(), ScenarioError> {
    for (key, entries) in [
        ("signal", scenario.signal.len()),
        ("fault", scenario.fault.len()),
        ("window", scenario.window.len()),
        ("expect", scenario.expect.len()),
    ] {
        if entries > ENTRIES_MAX {
            let problem = format!(
                "{entries} entries are more than the {ENTRIES_MAX} that are taken; a long course of a \
                 signal goes into a file of its own, by shape = \"file\""
            );
            return Err(ScenarioError::of_key(key, problem));
        }
    }
    scenario.bench.bench()?;
    scenario.params()?;
    let end_s = scenario.bench.duration_s;
    let after = |what: &str| format!("{what} after the end of the scenario, duration_s = {end_s}");
    for (index, fault) in scenario.faults()?.iter().enumerate() {
        if fault.at_s >= end_s {
            let key = format!("fault.{index}.at_s");
            return Err(ScenarioError::of_key(key, after("begins")));
        }
    }
    let mut last_s = f64::NEG_INFINITY;
    for (index, signal) in scenario.signal.iter().enumerate() {
        let wrong = |(key, problem): (&str, &str)| {
            ScenarioError::of_key(format!("signal.{index}.{key}"), problem)
        };
        if let Some(problem) = signal.problem() {
            return Err(wrong(problem));
        }
        if signal.at_s < last_s {
            return Err(wrong((
                "at_s",
                "stands after a later one; put them in order",
            )));
        }
        last_s = signal.at_s;
    }
    for (index, window) in scenario.window.iter().enumerate() {
        let wrong = |key: &str, problem: &str| {
            let problem = format!("the window {} {problem}", window.name);
            ScenarioError::of_key(format!("window.{index}.{key}"), problem)
        };
        let same = |other: &WindowTable| other.name == window.name;
        if scenario.window[..index].iter().any(same) {
            return Err(wrong("name", "is there twice; give each its own name"));
        }
        // Written so that NaN is refused too.
        if window.t0_s.partial_cmp(&window.t1_s) != Some(std::cmp::Ordering::Less) {
            return Err(wrong("t1_s", "has no time between t0_s and t1_s"));
        }
        // Its figures would cover a part of it, or nothing.
        if window.t0_s < 0.0 {
            return Err(wrong("t0_s", "begins before the scenario"));
        }
        if window.t1_s > end_s {
            return Err(wrong("t1_s", &after("ends")));
        }
    }
    let report = Summary::new(windows(scenario)).report(0.0, 0.0);
    for (index, expected) in scenario.expect.iter().enumerate() {
        let wrong = |error: ScenarioError| {
            ScenarioError::of_key(format!("expect.{index}"), error.to_string())
        };
        if let Some((key, problem)) = expected.problem() {
            return Err(ScenarioError::of_key(
                format!("expect.{index}.{key}"),
                problem,
            ));
        }
        judge(expected, &report).map_err(wrong)?;
    }
    Ok(())
}

/// Returns the measuring windows: those of the file, and the whole run if an expectation names it.
pub(super) fn windows(scenario: &Scenario) -> impl Iterator<Item = (String, f64, f64)> {
    let tables = scenario.window.iter();
    let tables = tables.map(|window| (window.name.clone(), window.t0_s, window.t1_s));
    let whole = scenario.window.iter().all(|window| window.name != RUN)
        && scenario.expect.iter().any(|e| e.window == RUN);
    tables.chain(whole.then(|| (RUN.to_owned(), 0.0, f64::INFINITY)))
}

/// Returns the drive's command that bypasses the wire. `last` is the previous one: converting a demand costs more than
/// a comparison, and few periods bring a new one.
fn past_the_wire(
    signals: &[Signal],
    t_s: f64,
    rig: &Rig,
    last: &Cell<(Option<Demand>, Option<Setpoint>)>,
) -> Option<Setpoint> {
    let demand = demand(signals, t_s);
    if demand != last.get().0 {
        last.set((demand, setpoint(demand?, &rig.config().scale)));
    }
    last.get().1
}

fn setpoint(demand: Demand, scale: &Scale) -> Option<Setpoint> {
    match demand {
        Demand::Throttle(_) => None,
        Demand::Rpm(0.0) => Some(Setpoint::Zero),
        Demand::Rpm(rpm) => Some(Setpoint::Speed(scale.speed_from_rpm(rpm as f32))),
        Demand::Amps(amps) => Some(Setpoint::Torque(scale.current_from_a(amps as f32))),
    }
}
