//! The command line of the Siskin ESC: parameters and live telemetry over MAVLink, images for boards,
//! captures of a throttle wire, and the limits of a motor.
//!
//! Results go to standard output. Complaints go to standard error, one line each; where another
//! program does the work, what that says stands before them. The exit status is 0 when everything
//! was done, 1 when the ESC or another program refused something or did not answer, and 2 for bad
//! input, no connection or a program that is not installed.
#![forbid(unsafe_code)]

mod budget;
mod cli;
pub mod decode;
mod endpoint;
mod error;
mod flash;
mod image;
mod json;
mod link;
mod message;
mod monitor;
mod param_commands;
mod param_file;
mod param_load;
mod params;
mod program;
mod sample;
mod session;

use std::io;
use std::process::ExitCode;

use clap::Parser;
use clap::error::ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand;

use cli::{Cli, Command};
use error::Error;
use link::Link;
use param_commands::Task;
use session::Session;

/// Does what the program's arguments say.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(e) if e.use_stderr() && e.kind() != DisplayHelpOnMissingArgumentOrSubcommand => {
            eprintln!("siskin: {}", one_line(&e.to_string()));
            return ExitCode::from(2);
        }
        // The help, which no argument at all stands for, or the version.
        Err(e) => e.exit(),
    };
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            let code = e.exit_code();
            if code != ExitCode::SUCCESS {
                eprintln!("siskin: {e}");
            }
            code
        }
    }
}

fn run(cli: &Cli) -> Result<(), Error> {
    let mut out = io::stdout().lock();
    let mut complaints = io::stderr().lock();
    let find = || Session::find(Link::open(&cli.connect)?, cli.system, cli.component);
    match &cli.command {
        Command::Params(command) => {
            let task = Task::check(command, &mut complaints)?;
            task.run(&mut find()?, &mut out, &mut complaints)
        }
        Command::Decode(args) => decode::run(&args.capture, &args.options, &mut out),
        Command::Budget(args) => budget::run(args, cli.component, &mut out),
        Command::Image(args) => image::run(args, &mut out),
        Command::Flash(args) => flash::run(args, &mut out),
        Command::Monitor(args) => monitor::run(&mut find()?, args, &mut out, &mut complaints),
    }
}

/// The argument parser's complaint and its hint on one line, without the usage that follows.
fn one_line(message: &str) -> String {
    let words: Vec<&str> = message
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage:"))
        .filter(|line| !line.is_empty() && !line.starts_with("For more information"))
        .collect();
    let words = words.join(" ");
    format!(
        "{} (see siskin --help)",
        words.strip_prefix("error: ").unwrap_or(&words)
    )
}
