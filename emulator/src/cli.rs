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
    /// Runs one ESC or several in real time, or in lockstep with a simulator (the default)
    Run(RunArgs),
    /// Runs a scenario from a file, offline
    Scenario(ScenarioArgs),
    /// Measures the figures of a paper
    Reproduce(ReproduceArgs),
    /// Measures how fast the emulator is on this machine
    Bench(BenchArgs),
    /// Plays every fault at every moment of a flight with either drive, and judges what the ESC makes of it
    Matrix(MatrixArgs),
    /// Draws a recording
    Plot(PlotArgs),
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
pub(crate) struct MatrixArgs {
    /// Draws them
    #[arg(short, long, value_name = "PICTURE.svg|.png")]
    pub(crate) output: Option<PathBuf>,
    /// Prints the cells as one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct PlotArgs {
    /// A recording, or the fault record of an ESC (.bin, from siskin faults --save)
    pub(crate) record: PathBuf,
    /// The picture to make
    #[arg(short, long, value_name = "PICTURE.svg|.png")]
    pub(crate) output: PathBuf,
}
