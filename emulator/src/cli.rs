//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use siskin_emulator::options::{RunArgs, ScenarioArgs};

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
    /// Run one ESC or several in real time, or in lockstep with a simulator (default)
    Run(RunArgs),
    /// Play a scenario from a file, offline
    Scenario(ScenarioArgs),
    /// Measure a paper's figures
    Reproduce(ReproduceArgs),
    /// Measure how fast the emulator is on this machine
    Bench(BenchArgs),
    /// Inject every fault at every moment of a flight, with both drives, and judge how the ESC reacts
    Matrix(MatrixArgs),
    /// Plot a recording
    Plot(PlotArgs),
}

#[derive(Args, Debug)]
pub(crate) struct ReproduceArgs {
    /// Paper to reproduce
    #[arg(value_enum)]
    pub(crate) paper: Paper,
    /// Plot the paper's figures into this folder, each as SVG and PNG
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: Option<PathBuf>,
    /// Print the figures as one JSON object
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
    /// Print the figures as one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct MatrixArgs {
    /// Plot the cells to this file
    #[arg(short, long, value_name = "PICTURE.svg|.png")]
    pub(crate) output: Option<PathBuf>,
    /// Print the cells as one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct PlotArgs {
    /// Recording, or an ESC's fault record (.bin, from siskin faults --save)
    pub(crate) record: PathBuf,
    /// Picture to write
    #[arg(short, long, value_name = "PICTURE.svg|.png")]
    pub(crate) output: PathBuf,
}
