//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use siskin_control::params::ParamId;
use siskin_emulator::link::Endpoint;
use siskin_emulator::live::Pace;
use siskin_emulator::parameter;
use siskin_emulator::plant::Supply;
use siskin_emulator::wire::SignalAddress;

/// The motor that the parameters' defaults describe.
pub(crate) const DEFAULT_MOTOR: &str = "antigravity-4006-kv380";

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
    /// A built-in motor or a TOML file
    #[arg(
        long,
        value_name = "NAME|FILE",
        default_value = DEFAULT_MOTOR
    )]
    pub(crate) motor: String,
    /// A built-in load or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "cfprop-13x4.4")]
    pub(crate) load: String,
    /// Supply: volts, or a battery as 4s or 6s
    #[arg(long, value_name = "VOLTS|Ns", default_value = "24", value_parser = bus)]
    pub(crate) bus: Supply,
    /// How the inverter is simulated
    #[arg(long, value_enum, default_value_t = Plant::Averaged)]
    pub(crate) plant: Plant,
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
    #[command(flatten)]
    pub(crate) common: CommonArgs,
}

#[derive(Args, Debug)]
pub(crate) struct CommonArgs {
    /// Sets a parameter before the start, over what is stored or in the file, without storing it; repeatable
    #[arg(long, value_name = "NAME=VALUE", value_parser = parameter::assignment)]
    pub(crate) param: Vec<(ParamId, f32)>,
    /// Writes each control period to a .csv file
    #[arg(long, value_name = "PATH")]
    pub(crate) record: Option<PathBuf>,
    /// Prints the summary as one JSON object at the end
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

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Plant {
    /// By its mean voltage over each half period
    Averaged,
}

fn bus(text: &str) -> Result<Supply, String> {
    siskin_emulator::bench::supply(text).map_err(|error| error.to_string())
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
