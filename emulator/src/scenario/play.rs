//! One run of a scenario.

use std::cell::Cell;
use std::path::Path;
use std::time::Instant;

use siskin_control::drive::Setpoint;
use siskin_control::units::Scale;

use super::RUN;
use super::error::ScenarioError;
use super::file::{Scenario, WindowTable};
use super::judge::{Verdict, judge};
use super::signal::{Demand, Signal, demand};
use crate::device::{Device, Start};
use crate::flash::FileFlash;
use crate::record::Recorder;
use crate::rig::Rig;
use crate::summary::{Report, Summary};
use crate::watch::{Watch, WatchError};
use crate::wire::Wire;

/// Plays a scenario.
pub(super) fn play(
    scenario: &Scenario,
    record: Option<&Path>,
) -> Result<(Report, Vec<Verdict>), ScenarioError> {
    let overrides = scenario.params()?;
    let recorder = record.map(Recorder::create).transpose();
    let recorder = recorder.map_err(WatchError::Record)?;
    let mut watch = Watch::new(windows(scenario), recorder);
    let (mut device, _) = Device::start(Start {
        bench: scenario.bench.bench()?,
        wire: Wire::detached(),
        flash: FileFlash::in_memory(),
        overrides,
        faults: scenario.faults()?,
        link_bytes_per_s: 11_520,
    })?;

    let began = Instant::now();
    let signals = &scenario.signal;
    let end_ns = (scenario.bench.duration_s * 1e9) as u64;
    let last = Cell::new((None, None));
    let mut slice_ns = 0;
    while slice_ns < end_ns && !watch.failed() {
        if let Some(Demand::Throttle(throttle)) = demand(signals, slice_ns as f64 * 1e-9) {
            let datagram = scenario
                .bench
                .wire
                .datagram(throttle, device.esc().params());
            // The longest pulse and its rest take 2.34 of 2.5 ms: there is room.
            let _ = device.wire().play(slice_ns, &datagram);
        }
        slice_ns += scenario.bench.wire.interval_ns();
        device.advance(
            slice_ns.min(end_ns),
            |t_s, rig| past_the_wire(signals, t_s, rig, &last),
            &mut watch,
            &mut |_| {},
        );
    }
    let sim_s = device.now_ns() as f64 * 1e-9;
    let report = watch.finish(sim_s, began.elapsed().as_secs_f64())?;
    let expectations = scenario.expect.iter();
    let verdicts = expectations.map(|expected| judge(expected, &report));
    let verdicts = verdicts.collect::<Result<_, _>>()?;
    Ok((report, verdicts))
}

/// Finds what is wrong with a scenario before it is played, so that a slip of the pen does not cost
/// its time.
pub(super) fn check(scenario: &Scenario) -> Result<(), ScenarioError> {
    scenario.bench.bench()?;
    scenario.params()?;
    scenario.faults()?;
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
        let wrong = |key: &str, problem| {
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
    }
    let report = Summary::new(windows(scenario)).report(0.0, 0.0);
    for (index, expected) in scenario.expect.iter().enumerate() {
        let wrong = |error: ScenarioError| {
            ScenarioError::of_key(format!("expect.{index}"), error.to_string())
        };
        judge(expected, &report).map_err(wrong)?;
    }
    Ok(())
}

/// The measuring windows: those of the file, and the whole run where a figure of it is expected.
fn windows(scenario: &Scenario) -> impl Iterator<Item = (String, f64, f64)> {
    let tables = scenario.window.iter();
    let tables = tables.map(|window| (window.name.clone(), window.t0_s, window.t1_s));
    let whole = scenario.window.iter().all(|window| window.name != RUN)
        && scenario.expect.iter().any(|e| e.window == RUN);
    tables.chain(whole.then(|| (RUN.to_owned(), 0.0, f64::INFINITY)))
}

/// What is asked of the drive past the wire. `last` is what that was before: a demand is worth more
/// than a comparison to convert, and few periods bring another.
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
