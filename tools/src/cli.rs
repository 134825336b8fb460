//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

use crate::endpoint::Endpoint;

/// Parameters and live telemetry of a Siskin ESC over MAVLink.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
pub(crate) struct Cli {
    /// tcp:HOST:PORT, udpin:HOST:PORT (wait for a vehicle, usually on 14550), udpout:HOST:PORT or
    /// serial:PATH:BAUD.
    #[arg(
        long,
        global = true,
        value_name = "ENDPOINT",
        default_value = "tcp:127.0.0.1:5760"
    )]
    pub(crate) connect: Endpoint,

    /// System id to talk to, instead of that of the first ESC heard.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub(crate) system: Option<u8>,

    /// Component id to talk to, instead of that of the first ESC heard.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub(crate) component: Option<u8>,

    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Read, change, save and load parameters.
    #[command(subcommand)]
    Params(ParamsCommand),
    /// Show speed, voltage, current and faults as they come.
    Monitor(MonitorArgs),
}

/// What to do with parameters.
#[derive(Debug, Subcommand)]
pub(crate) enum ParamsCommand {
    /// Print every parameter in the order of the ESC.
    List {
        /// One JSON object, name to value.
        #[arg(long)]
        json: bool,
    },
    /// Print the named parameters.
    Get {
        /// One JSON object, name to value.
        #[arg(long)]
        json: bool,
        /// Names in any case, for example MOT_POLE_PAIRS.
        #[arg(required = true, value_name = "NAME")]
        names: Vec<String>,
    },
    /// Change parameters; they last until power-off unless stored.
    Set {
        /// Store all parameters in the ESC afterwards.
        #[arg(long)]
        store: bool,
        /// Names, in any case, and values in turn, for example LIM_PHASE_A 15 MOT_STOP 0.
        #[arg(required = true, value_names = ["NAME", "VALUE"], num_args = 2.., allow_negative_numbers = true)]
        pairs: Vec<String>,
    },
    /// Write every parameter to a file that MAVProxy and Mission Planner read too.
    Save {
        /// File to write, usually NAME.param.
        file: PathBuf,
    },
    /// Set what a file says; MAVProxy's, Mission Planner's and QGroundControl's files are read.
    Load {
        /// Store all parameters in the ESC afterwards, if none was refused.
        #[arg(long)]
        store: bool,
        /// File to read.
        file: PathBuf,
    },
}

/// How to show telemetry.
#[derive(Debug, Args)]
pub(crate) struct MonitorArgs {
    /// One JSON object a line: a sample of one ESC, or a message.
    #[arg(long)]
    pub(crate) json: bool,
    /// End after N samples.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) count: Option<u64>,
}
