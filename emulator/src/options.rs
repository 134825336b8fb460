//! The options of a real-time run and of a scenario, for every program that has one.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use clap::builder::RangedU64ValueParser;
use siskin_params::{ParamId, Preset};
use siskin_scope::printable;

use crate::bench::library;
use crate::fault::Fault;
use crate::flash::{FileFlash, StorageError};
use crate::link::Endpoint;
use crate::live::{Pace, Session};
use crate::parameter;
use crate::plant::Fidelity;
use crate::rack::ESCS_MAX;
use crate::rig::Bench;
use crate::scenario::{self, Plan, ScenarioError, Standing};
use crate::web::WebAddress;
use crate::wire::SignalAddress;

/// The help of `--mavlink`, whose brackets would be links in the documentation.
const MAVLINK_HELP: &str = "MAVLink endpoint: udpout:H:P, udpin:H:P, tcpin:H:P, serial:PATH:BAUD, \
    pty[:LINK[:BAUD]] or none; repeatable [default: udpout:127.0.0.1:14550 and tcpin:127.0.0.1:5760]";

/// How simulated time advances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Speed {
    /// By wall time, or as fast as the machine can.
    Paced(Pace),
    /// Under a client's control ([`lockstep`](crate::lockstep)).
    Lockstep,
}

/// What one ESC in real time is run with, or several.
#[derive(Args, Debug)]
pub struct RunArgs {
    /// MAVLink endpoints.
    #[arg(long, value_name = "ENDPOINT", help = MAVLINK_HELP)]
    pub mavlink: Vec<Endpoint>,
    /// Address on which the throttle wire listens
    #[arg(long, value_name = "udp:H:P", default_value = "udp:127.0.0.1:14600")]
    pub signal: SignalAddress,
    /// Number of ESCs, on one MAVLink link and one supply: several are peripherals, components MAV_COMP_ID (140)
    /// and up; ESC i takes throttle on the port i higher
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = RangedU64ValueParser::<usize>::new().range(1..=ESCS_MAX as u64))]
    pub escs: usize,
    /// Built-in bench or TOML file
    #[arg(long, value_name = "NAME|FILE", help = bench_help())]
    pub bench: Option<String>,
    /// Built-in motor or TOML file [default: the bench's]
    #[arg(long, value_name = "NAME|FILE")]
    pub motor: Option<String>,
    /// Built-in load or TOML file [default: the bench's]
    #[arg(long, value_name = "NAME|FILE")]
    pub load: Option<String>,
    /// Supply: volts, a battery such as 4s or 6s, or a TOML file [default: the bench's]
    #[arg(long, value_name = "VOLTS|Ns|FILE", allow_hyphen_values = true)]
    pub bus: Option<String>,
    /// Address on which to serve the scope's page, or none [default: 127.0.0.1:8080, or none if that is taken]
    #[arg(long, value_name = "HOST:PORT|none")]
    pub web: Option<WebAddress>,
    /// Inverter model
    #[arg(long, value_enum, default_value_t = Fidelity::Averaged)]
    pub plant: Fidelity,
    /// Simulated seconds per second, max, or lockstep: advanced by a client on the throttle wire
    #[arg(long, value_name = "X|max|lockstep", default_value = "1", value_parser = speed)]
    pub speed: Speed,
    /// Simulated time after which to stop, s
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub duration: Option<f64>,
    /// Random seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// File that holds the simulated flash (PATH.0, PATH.1 ... with several ESCs), or none [default: a file in your
    /// state folder]
    #[arg(long, value_name = "PATH|none")]
    pub storage: Option<PathBuf>,
    /// Fault, with a scenario's keys, such as kind = "mosfet_open", phase = 1; acts from the start unless it has
    /// at_s; repeatable
    #[arg(long, value_name = "KEYS", value_parser = scenario::fault)]
    pub fault: Vec<Fault>,
    /// What runs in real time and offline have in common.
    #[command(flatten)]
    pub common: CommonArgs,
}

/// What a scenario is played with.
#[derive(Args, Debug)]
pub struct ScenarioArgs {
    /// Scenario, a TOML file
    pub file: PathBuf,
    /// Seed, instead of the file's
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Play the scenario with each seed from A to B, inclusive
    #[arg(long, value_name = "A..B", value_parser = seeds, conflicts_with = "seed")]
    pub seeds: Option<RangeInclusive<u64>>,
    /// Set a key of the file to one value, instead of sweeping or drawing it, such as bench.scale.R=0.7
    /// or signal.0.rpm=3000.0 (entries count from 0); repeatable
    #[arg(long, value_name = "KEY=VALUE", value_parser = key)]
    pub set: Vec<(String, toml::Value)>,
    /// Write a row for each run to .csv or .parquet: its seed, swept and drawn keys, figures and verdicts
    #[arg(long, value_name = "PATH")]
    pub table: Option<PathBuf>,
    /// What runs in real time and offline have in common.
    #[command(flatten)]
    pub common: CommonArgs,
}

/// What both have.
#[derive(Args, Debug)]
pub struct CommonArgs {
    /// Set the parameters of a preset before the start, as --param does: bosso-table-iii is the
    /// first paper's drive as published
    #[arg(long, value_name = "NAME", value_parser = parameter::preset)]
    pub preset: Option<&'static Preset>,
    /// Set a parameter before the start, overriding what is stored or in the file, without storing it; repeatable
    #[arg(long, value_name = "NAME=VALUE", value_parser = parameter::assignment)]
    pub param: Vec<(ParamId, f32)>,
    /// Record to a file: each control period to .csv or .parquet, the wires to .vcd, MAVLink to .tlog
    #[arg(long, value_name = "PATH")]
    pub record: Option<PathBuf>,
    /// Print the summary as one JSON object at the end
    #[arg(long)]
    pub json: bool,
}

impl ScenarioArgs {
    /// Reads the plan of the file with these options.
    ///
    /// # Errors
    /// Any [`ScenarioError`] that shows before it is played.
    pub fn plan(&self) -> Result<Plan, ScenarioError> {
        let seeds = self.seeds.clone().or(self.seed.map(|seed| seed..=seed));
        let options = scenario::Options {
            seeds,
            set: self.keys(),
            record: self.common.record.clone(),
        };
        Plan::read(&self.file, &options)
    }

    /// Returns the keys that are set, including parameters: what reproduces a run is then one list.
    fn keys(&self) -> Vec<(String, toml::Value)> {
        let of_param = |(id, value): (ParamId, f32)| {
            // Via its shortest text: 75.6 stays 75.6 as a double.
            let value = value.to_string().parse().unwrap_or(f64::from(value));
            let key = format!("params.{}", id.entry().name);
            (key, toml::Value::Float(value))
        };
        let params = self.common.params().into_iter().map(of_param);
        params.chain(self.set.iter().cloned()).collect()
    }
}

impl RunArgs {
    /// Returns the bench.
    ///
    /// # Errors
    /// What is named does not exist, or makes no bench.
    pub fn standing(&self) -> Result<Standing, ScenarioError> {
        let given = [
            ("motor", &self.motor),
            ("load", &self.load),
            ("bus", &self.bus),
        ];
        let given = given.into_iter().filter_map(|(key, text)| {
            let text = text.clone()?;
            Some((key.to_owned(), toml::Value::String(text)))
        });
        let base = self.bench.as_deref().unwrap_or(library::DEFAULT);
        let standing = scenario::stand(base, given.collect())?;
        Ok(Standing {
            bench: Bench {
                plant: self.plant,
                seed: self.seed,
                ..standing.bench
            },
            ..standing
        })
    }
}

impl RunArgs {
    /// Creates the session on this bench, with a warning if settings do not outlive it and nobody has asked for that.
    ///
    /// # Errors
    /// The file behind `--storage` is unusable.
    pub fn session(&self, standing: &Standing) -> Result<(Session, Option<String>), StorageError> {
        let (flash, warning) = storage(self.storage.as_deref(), self.escs)?;
        let of_bench = standing.params.clone();
        // The default bench needs no request, and lasts from run to run: what was stored on it is found again.
        let (defaults, mut params) = match self.bench {
            None => (of_bench, Vec::new()),
            Some(_) => (Vec::new(), of_bench),
        };
        params.extend(self.common.params());
        let session = Session {
            bench: standing.bench.clone(),
            names: standing.names.clone(),
            mavlink: if self.mavlink.is_empty() {
                Endpoint::defaults()
            } else {
                self.mavlink.clone()
            },
            signal: self.signal.clone(),
            pace: match self.speed {
                Speed::Paced(pace) => pace,
                Speed::Lockstep => Pace::Max,
            },
            duration: self.duration.map(Duration::from_secs_f64),
            flash,
            params,
            defaults,
            faults: self.fault.clone(),
            record: self.common.record.clone(),
            web: self.web.clone().unwrap_or_default(),
        };
        Ok((session, warning))
    }
}

impl CommonArgs {
    /// Returns the preset's parameters, followed by those given individually, which override them.
    pub fn params(&self) -> Vec<(ParamId, f32)> {
        let preset = self.preset.map_or(&[][..], |preset| preset.settings);
        preset.iter().chain(&self.param).copied().collect()
    }
}

/// Opens the flash behind `--storage`, by default in the user's state folder.
///
/// Returns it with a warning if settings do not outlive the run and nobody has asked for that.
///
/// # Errors
/// The given file is unusable.
fn storage(
    given: Option<&Path>,
    escs: usize,
) -> Result<(Vec<FileFlash>, Option<String>), StorageError> {
    let in_memory = || (0..escs).map(|_| FileFlash::in_memory()).collect();
    match given {
        Some(path) if path == Path::new("none") => Ok((in_memory(), None)),
        Some(path) => Ok((FileFlash::open_each(path, escs)?, None)),
        None => {
            let why = match state_file().map(|path| FileFlash::open_each(&path, escs)) {
                Some(Ok(flash)) => return Ok((flash, None)),
                Some(Err(error)) => format!("{error};"),
                None => "no home folder:".to_owned(),
            };
            let warning = format!("{why} settings are kept only until the program ends");
            Ok((in_memory(), Some(warning)))
        }
    }
}

/// Returns where settings persist between runs: the state folder of the XDG base directories.
fn state_file() -> Option<PathBuf> {
    let absolute = |name| {
        let path = PathBuf::from(std::env::var_os(name)?);
        path.is_absolute().then_some(path)
    };
    let folder =
        absolute("XDG_STATE_HOME").or_else(|| Some(absolute("HOME")?.join(".local/state")));
    Some(folder?.join("siskin/esc.flash"))
}

/// Handles a command line that clap rejects, or that asks for help or the version: these as clap prints them, an error
/// in one line.
pub fn usage(program: &str, error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        // Nobody is left to tell if standard output is closed.
        let _ = error.print();
        return ExitCode::SUCCESS;
    }
    let what = one_line(&error.to_string());
    complain(program, &format!("{what}; try --help"));
    ExitCode::from(2)
}

/// Tells the user a line on standard error; what of it comes from a file cannot command the terminal.
pub fn complain(program: &str, line: &str) {
    eprintln!("{program}: {}", printable::line(line));
}

/// Returns the argument parser's complaint and its hint on one line, without the usage that follows.
fn one_line(message: &str) -> String {
    let lines = message.lines().map(str::trim);
    let said = lines.take_while(|line| !line.starts_with("Usage:"));
    let said = said.filter(|line| !line.is_empty() && !line.starts_with("For more information"));
    let words = said.collect::<Vec<_>>().join(" ");
    words.trim_start_matches("error: ").to_owned()
}

fn bench_help() -> String {
    let names: Vec<_> = library::names().collect();
    format!(
        "Built-in bench ({}) or TOML file: motor, load, supply and the parameters that the ESC \
         needs for them, set before the start as by --param [default: {}, whose parameters \
         yield to stored ones]",
        names.join(", "),
        library::DEFAULT
    )
}

fn speed(text: &str) -> Result<Speed, String> {
    match text {
        "max" => return Ok(Speed::Paced(Pace::Max)),
        "lockstep" => return Ok(Speed::Lockstep),
        _ => {}
    }
    let times = text.parse().ok();
    let times = times.filter(|times| (0.001..=1000.0).contains(times));
    times
        .map(|times| Speed::Paced(Pace::Times(times)))
        .ok_or_else(|| "give 0.001 to 1000, max or lockstep".to_owned())
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok();
    seconds
        .filter(|seconds| (0.0..=1e7).contains(seconds))
        .ok_or_else(|| "give seconds from 0 to 1e7".to_owned())
}

fn seeds(text: &str) -> Result<RangeInclusive<u64>, String> {
    let ends = text.split_once("..");
    let ends = ends.and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
    match ends {
        Some((first, last)) if first <= last => Ok(first..=last),
        _ => Err("give the first and the last seed, as 1..200".to_owned()),
    }
}

/// Parses a value as TOML, or else as text: quotes are for what would be a number.
fn key(text: &str) -> Result<(String, toml::Value), String> {
    let (key, value) = text
        .split_once('=')
        .ok_or_else(|| "give a key of the file and its value, as bench.scale.R=0.7".to_owned())?;
    let parsed = toml::from_str::<toml::Table>(&format!("value = {value}"));
    let parsed = parsed.ok().and_then(|mut table| table.remove("value"));
    let value = parsed.unwrap_or_else(|| toml::Value::String(value.to_owned()));
    Ok((key.to_owned(), value))
}
