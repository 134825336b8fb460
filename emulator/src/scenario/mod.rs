//! A run from a file, offline: a bench, signals, measuring windows and expectations.

mod file;
mod signal;

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;
use siskin_control::drive::Setpoint;
use siskin_control::input::dshot;
use siskin_control::params::ParamId;
use thiserror::Error;

use crate::bench::{BenchError, toml_reason};
use crate::device::{Device, Start, StartError};
use crate::flash::FileFlash;
use crate::rig::Rig;
use crate::summary::{Report, Summary};
use crate::watch::{Watch, WatchError};
use crate::wire::Wire;
use file::{Expectation, Protocol, Scenario, WindowTable};
use signal::{Demand, Signal, demand};

/// Time between two frames on the wire: what a flight controller's loop of 1 kHz sends.
const FRAME_NS: u64 = 1_000_000;

/// Why a scenario cannot run; one line without the file's name.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("{0}")]
    Read(std::io::Error),
    /// It is not a scenario.
    #[error("{0}")]
    Syntax(String),
    /// Something that cannot stand on the bench.
    #[error("bench: {0}")]
    Bench(#[from] BenchError),
    /// A quantity out of range.
    #[error("{key} = {value} is out of range; give {least} to {most}")]
    Range {
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
        /// The least.
        least: f64,
        /// The greatest.
        most: f64,
    },
    /// A delay that no board has.
    #[error("bench.delay_periods = {0}; give 0, 0.5 or 1")]
    Delay(f64),
    /// A parameter that there is not or that is out of range.
    #[error("params: {0}")]
    Parameter(String),
    /// A signal that makes no sense.
    #[error("the signal at {at_s} s {problem}")]
    Signal {
        /// Its time.
        at_s: f64,
        /// What is wrong.
        problem: &'static str,
    },
    /// Signals out of order.
    #[error("the signal at {0} s stands after a later one; put them in order")]
    Order(f64),
    /// A window without time.
    #[error("the window {0} has no time between t0_s and t1_s")]
    Window(String),
    /// Two windows of one name.
    #[error("there are two windows {0}; give each its own name")]
    Twice(String),
    /// An expectation of no window, of no figure, or of nothing.
    #[error("the expectation of {window}.{key} {problem}")]
    Expectation {
        /// The window's name.
        window: String,
        /// The figure's key.
        key: String,
        /// What is wrong.
        problem: &'static str,
    },
    /// The ESC does not start.
    #[error("{0}")]
    Start(#[from] StartError),
    /// The plant or the recording.
    #[error("{0}")]
    Watch(#[from] WatchError),
}

/// The summary of a scenario.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// The figures.
    #[serde(flatten)]
    pub report: Report,
    /// What was expected of them.
    pub expectations: Vec<Verdict>,
}

/// Whether an expectation held.
#[derive(Clone, Debug, Serialize)]
pub struct Verdict {
    /// The window's name.
    pub window: String,
    /// The figure's key.
    pub key: String,
    /// The figure; a true boolean counts as 1.
    pub value: Option<f64>,
    /// What it must be.
    pub wanted: String,
    /// Whether it is.
    pub held: bool,
}

impl Outcome {
    /// Whether every expectation held.
    pub fn held(&self) -> bool {
        self.expectations.iter().all(|verdict| verdict.held)
    }
}

/// What the command line changes in a scenario.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Another seed.
    pub seed: Option<u64>,
    /// Parameters over those of the file.
    pub params: Vec<(ParamId, f32)>,
    /// Where each period is written.
    pub record: Option<PathBuf>,
}

/// Runs the scenario in the file at `path`.
pub fn run(path: &Path, options: &Options) -> Result<Outcome, ScenarioError> {
    let text = std::fs::read_to_string(path).map_err(ScenarioError::Read)?;
    let scenario = toml::from_str::<Scenario>(&text)
        .map_err(|error| ScenarioError::Syntax(toml_reason(&text, &error)))?;
    check(&scenario)?;
    let mut bench = scenario.bench.bench()?;
    bench.seed = options.seed.unwrap_or(bench.seed);
    let mut overrides = scenario.params()?;
    overrides.extend(&options.params);
    let mut watch = Watch::new(windows(&scenario), options.record.as_deref())?;
    let (mut device, _) = Device::start(Start {
        bench,
        wire: Wire::detached(),
        flash: FileFlash::in_memory(),
        overrides,
        link_bytes_per_s: 11_520,
    })?;

    let began = Instant::now();
    let signals = &scenario.signal;
    let end_ns = (scenario.bench.duration_s * 1e9) as u64;
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
            |t_s, rig| past_the_wire(signals, t_s, rig),
            |t_s, period, rig| watch.period(t_s, period, rig),
            &mut |_| {},
        );
    }
    let sim_s = device.now_ns() as f64 * 1e-9;
    let report = watch.finish(sim_s, began.elapsed().as_secs_f64())?;
    let expectations = scenario.expect.iter();
    let expectations = expectations
        .map(|expected| judge(expected, &report))
        .collect::<Result<_, _>>()?;
    Ok(Outcome {
        report,
        expectations,
    })
}

fn check(scenario: &Scenario) -> Result<(), ScenarioError> {
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
    // Before the run, so that a slip of the pen does not cost its time.
    let report = Summary::new(windows(scenario)).report(0.0, 0.0);
    for expected in &scenario.expect {
        judge(expected, &report)?;
    }
    Ok(())
}

fn windows(scenario: &Scenario) -> impl Iterator<Item = (String, f64, f64)> {
    let tables = scenario.window.iter();
    tables.map(|window| (window.name.clone(), window.t0_s, window.t1_s))
}

/// What is asked of the drive past the wire.
fn past_the_wire(signals: &[Signal], t_s: f64, rig: &Rig) -> Option<Setpoint> {
    let scale = &rig.config().scale;
    match demand(signals, t_s)? {
        Demand::Throttle(_) => None,
        Demand::Rpm(rpm) if rpm > 0.0 => Some(Setpoint::Speed(scale.speed_from_rpm(rpm as f32))),
        Demand::Rpm(_) => Some(Setpoint::Zero),
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

fn judge(expected: &Expectation, report: &Report) -> Result<Verdict, ScenarioError> {
    let wrong = |problem| ScenarioError::Expectation {
        window: expected.window.clone(),
        key: expected.key.clone(),
        problem,
    };
    let window = report.windows.iter().find(|w| w.name == expected.window);
    let figures = window.ok_or_else(|| wrong("names no window"))?;
    let figures = serde_json::to_value(figures).map_err(|_| wrong("cannot be read"))?;
    let value = match figures.get(&expected.key) {
        Some(serde_json::Value::Bool(flag)) => Some(f64::from(u8::from(*flag))),
        Some(serde_json::Value::String(_)) | None => return Err(wrong("names no figure")),
        Some(number) => number.as_f64(),
    };
    let mut wanted = Vec::new();
    let mut held = value.is_some();
    let value_or_nan = value.unwrap_or(f64::NAN);
    if let Some(limit) = expected.below {
        wanted.push(format!("below {limit}"));
        held &= value_or_nan < limit;
    }
    if let Some(limit) = expected.above {
        wanted.push(format!("above {limit}"));
        held &= value_or_nan > limit;
    }
    match (expected.equals, expected.within) {
        (Some(target), Some(within)) => {
            wanted.push(format!("{target} ± {within}"));
            held &= (value_or_nan - target).abs() <= within;
        }
        (None, None) => {}
        _ => return Err(wrong("needs both equals and within")),
    }
    if wanted.is_empty() {
        return Err(wrong("says neither below, above nor equals"));
    }
    Ok(Verdict {
        window: expected.window.clone(),
        key: expected.key.clone(),
        value,
        wanted: wanted.join(" and "),
        held,
    })
}
