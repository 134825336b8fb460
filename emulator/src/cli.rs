//! The command line.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use siskin_control::params::{ParamId, Preset};
use siskin_emulator::bench::library;
use siskin_emulator::link::Endpoint;
use siskin_emulator::live::Pace;
use siskin_emulator::parameter;
use siskin_emulator::plant::Fidelity;
use siskin_emulator::rig::Bench;
use siskin_emulator::scenario::{self, ScenarioError, Standing};
use siskin_emulator::wire::SignalAddress;

/// A brushless ESC on your desk: the firmware's own control code turns a simulated motor.
#[derive(Debug, Parser)]
#[command(
    name = "siskin-emulator",
    version,
    args_conflicts_with_subcommands = true
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Runs one ESC in real time (the default)
    Run(RunArgs),
    /// Runs a scenario from a file, offline
    Scenario(ScenarioArgs),
    /// Measures the figures of a paper
    Reproduce(ReproduceArgs),
    /// Measures how fast the emulator is on this machine
    Bench(BenchArgs),
    /// Draws a recording
    Plot(PlotArgs),
}

#[derive(Args, Debug)]
pub(crate) struct RunArgs {
    /// MAVLink endpoint: udpout:H:P, udpin:H:P, tcpin:H:P, serial:PATH:BAUD, pty[:LINK[:BAUD]] or
    /// none; repeatable [default: udpout:127.0.0.1:14550 and tcpin:127.0.0.1:5760]
    #[arg(long, value_name = "ENDPOINT")]
    pub(crate) mavlink: Vec<Endpoint>,
    /// Where the throttle wire listens
    #[arg(long, value_name = "udp:H:P", default_value = "udp:127.0.0.1:14600")]
    pub(crate) signal: SignalAddress,
    #[arg(long, value_name = "NAME|FILE", help = bench_help())]
    pub(crate) bench: Option<String>,
    /// A built-in motor or a TOML file [default: the bench's]
    #[arg(long, value_name = "NAME|FILE")]
    pub(crate) motor: Option<String>,
    /// A built-in load or a TOML file [default: the bench's]
    #[arg(long, value_name = "NAME|FILE")]
    pub(crate) load: Option<String>,
    /// Supply: volts, a battery as 4s or 6s, or a TOML file [default: the bench's]
    #[arg(long, value_name = "VOLTS|Ns|FILE", allow_hyphen_values = true)]
    pub(crate) bus: Option<String>,
    /// How the inverter is simulated
    #[arg(long, value_enum, default_value_t = Fidelity::Averaged)]
    pub(crate) plant: Fidelity,
    /// Simulated seconds a second, or max
    #[arg(long, value_name = "X|max", default_value = "1", value_parser = pace)]
    pub(crate) speed: Pace,
    /// Simulated seconds after which to end
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub(crate) duration: Option<f64>,
    /// Seed of all randomness
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// File behind the simulated flash, or none [default: a file in your state folder]
    #[arg(long, value_name = "PATH|none")]
    pub(crate) storage: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) common: CommonArgs,
}

#[derive(Args, Debug)]
pub(crate) struct ScenarioArgs {
    /// The scenario, a TOML file
    pub(crate) file: PathBuf,
    /// Another seed than the file's
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Runs the scenario for each seed from A to B, both included
    #[arg(long, value_name = "A..B", value_parser = seeds, conflicts_with = "seed")]
    pub(crate) seeds: Option<RangeInclusive<u64>>,
    /// Gives a key of the file one value, in place of what sweeps or draws it, as bench.scale.R=0.7
    /// or signal.0.rpm=3000.0 (entries count from 0); repeatable
    #[arg(long, value_name = "KEY=VALUE", value_parser = key)]
    pub(crate) set: Vec<(String, toml::Value)>,
    #[command(flatten)]
    pub(crate) common: CommonArgs,
}

#[derive(Args, Debug)]
pub(crate) struct CommonArgs {
    /// Sets the parameters of a named set before the start, as --param does: bosso-table-iii is the
    /// first paper's drive as published
    #[arg(long, value_name = "NAME", value_parser = parameter::preset)]
    pub(crate) preset: Option<&'static Preset>,
    /// Sets a parameter before the start, over what is stored or in the file, without storing it; repeatable
    #[arg(long, value_name = "NAME=VALUE", value_parser = parameter::assignment)]
    pub(crate) param: Vec<(ParamId, f32)>,
    /// Records to a file: each control period to .csv or .parquet, the wires to .vcd, MAVLink to .tlog
    #[arg(long, value_name = "PATH")]
    pub(crate) record: Option<PathBuf>,
    /// Prints the summary as one JSON object at the end
    #[arg(long)]
    pub(crate) json: bool,
}

impl ScenarioArgs {
    /// The keys that are set, parameters among them: what repeats a run is then one list.
    pub(crate) fn keys(&self) -> Vec<(String, toml::Value)> {
        let of_param = |(id, value): (ParamId, f32)| {
            // By way of its shortest text: 75.6 stays 75.6 as a double.
            let value = value.to_string().parse().unwrap_or(f64::from(value));
            let key = format!("params.{}", id.entry().name);
            (key, toml::Value::Float(value))
        };
        let params = self.common.params().into_iter().map(of_param);
        params.chain(self.set.iter().cloned()).collect()
    }
}

impl RunArgs {
    /// What stands on the bench.
    pub(crate) fn standing(&self) -> Result<Standing, ScenarioError> {
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

impl CommonArgs {
    /// The preset's parameters, and those given one by one over them.
    pub(crate) fn params(&self) -> Vec<(ParamId, f32)> {
        let preset = self.preset.map_or(&[][..], |preset| preset.settings);
        preset.iter().chain(&self.param).copied().collect()
    }
}

#[derive(Args, Debug)]
pub(crate) struct ReproduceArgs {
    /// The paper
    #[arg(value_enum)]
    pub(crate) paper: Paper,
    /// Draws the paper's figures into this folder, each as SVG and PNG
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: Option<PathBuf>,
    /// Prints the figures as one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Paper {
    /// Adaptive observer: A. Bosso et al., 2021
    Bosso,
    /// Flux crossings: S. Colton, 2014
    Colton,
}

#[derive(Args, Debug)]
pub(crate) struct BenchArgs {
    /// Prints the figures as one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct PlotArgs {
    /// A recording
    pub(crate) record: PathBuf,
    /// The picture to make
    #[arg(short, long, value_name = "PICTURE.svg|.png")]
    pub(crate) output: PathBuf,
}

fn bench_help() -> String {
    let names: Vec<_> = library::names().collect();
    format!(
        "A built-in bench ({}) or a TOML file: motor, load, supply and the parameters that the ESC \
         needs for them, set before the start as --param does [default: {}, without setting any]",
        names.join(", "),
        library::DEFAULT
    )
}

fn pace(text: &str) -> Result<Pace, String> {
    if text == "max" {
        return Ok(Pace::Max);
    }
    let times = text.parse().ok();
    let times = times.filter(|times| (0.001..=1000.0).contains(times));
    times
        .map(Pace::Times)
        .ok_or_else(|| "give 0.001 to 1000, or max".to_owned())
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

/// A value is TOML, or else text: quotes are for what would be a number.
fn key(text: &str) -> Result<(String, toml::Value), String> {
    let (key, value) = text
        .split_once('=')
        .ok_or_else(|| "give a key of the file and its value, as bench.scale.R=0.7".to_owned())?;
    let parsed = toml::from_str::<toml::Table>(&format!("value = {value}"));
    let parsed = parsed.ok().and_then(|mut table| table.remove("value"));
    let value = parsed.unwrap_or_else(|| toml::Value::String(value.to_owned()));
    Ok((key.to_owned(), value))
}
