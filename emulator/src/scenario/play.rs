//! One run of a scenario.

use std::cell::Cell;
use std::path::Path;
use std::time::Instant;

use siskin_control::drive::Setpoint;
use siskin_control::input::dshot;
use siskin_control::units::Scale;

use super::RUN;
use super::error::ScenarioError;
use super::file::{Protocol, Scenario, WindowTable};
use super::judge::{Verdict, judge};
use super::signal::{Demand, Signal, demand};
use crate::device::{Device, Start};
use crate::flash::FileFlash;
use crate::rig::Rig;
use crate::summary::{Report, Summary};
use crate::watch::Watch;
use crate::wire::Wire;

/// Time between two frames on the wire: what a flight controller's loop of 1 kHz sends.
const FRAME_NS: u64 = 1_000_000;

/// Plays a scenario.
pub(super) fn play(
    scenario: &Scenario,
    record: Option<&Path>,
) -> Result<(Report, Vec<Verdict>), ScenarioError> {
    let overrides = scenario.params()?;
    let mut watch = Watch::new(windows(scenario), record)?;
    let (mut device, _) = Device::start(Start {
        bench: scenario.bench.bench()?,
        wire: Wire::detached(),
        flash: FileFlash::in_memory(),
        overrides,
        link_bytes_per_s: 11_520,
    })?;

    let began = Instant::now();
    let signals = &scenario.signal;
    let end_ns = (scenario.bench.duration_s * 1e9) as u64;
    let last = Cell::new((None, None));
    let mut slice_ns = 0;
    while slice_ns < end_ns && !watch.failed() {
        if let Some(Demand::Throttle(throttle)) = demand(signals, slice_ns as f64 * 1e-9) {
            let datagram = frame(scenario.bench.wire, throttle);
            // A frame takes a tenth of the time to the next at the slowest rate: there is room.
            let _ = device.wire().play(slice_ns, &datagram);
        }
        slice_ns += FRAME_NS;
        device.advance(
            slice_ns.min(end_ns),
            |t_s, rig| past_the_wire(signals, t_s, rig, &last),
            |t_s, period, rig| watch.period(t_s, period, rig),
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
    let mut last_s = f64::NEG_INFINITY;
    for signal in &scenario.signal {
        let at_s = signal.at_s;
        if let Some(problem) = signal.problem() {
            return Err(ScenarioError::Signal { at_s, problem });
        }
        if at_s < last_s {
            return Err(ScenarioError::Order(at_s));
        }
        last_s = at_s;
    }
    for window in &scenario.window {
        let same = |other: &&WindowTable| other.name == window.name;
        if scenario.window.iter().filter(same).count() > 1 {
            return Err(ScenarioError::Twice(window.name.clone()));
        }
        // Written so that NaN is refused too.
        if window.t0_s.partial_cmp(&window.t1_s) != Some(std::cmp::Ordering::Less) {
            return Err(ScenarioError::Window(window.name.clone()));
        }
    }
    let report = Summary::new(windows(scenario)).report(0.0, 0.0);
    for expected in &scenario.expect {
        judge(expected, &report)?;
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

/// A datagram of the throttle wire.
fn frame(protocol: Protocol, throttle: f64) -> [u8; 3] {
    let value = if throttle > 0.0 {
        48 + libm::round(throttle * 1999.0) as u16
    } else {
        0
    };
    let bits = dshot::Frame {
        value,
        telemetry: false,
    }
    .to_bits();
    let [low, high] = bits.to_le_bytes();
    let code = match protocol {
        Protocol::Dshot150 => 10,
        Protocol::Dshot300 => 11,
        Protocol::Dshot600 => 12,
    };
    [code, low, high]
}
