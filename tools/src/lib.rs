#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod budget;
mod check;
mod cli;
pub mod decode;
mod endpoint;
mod error;
mod factory;
mod faults;
mod flash;
mod ftp;
mod given;
mod identify;
mod image;
mod interrupt;
mod json;
mod key;
mod link;
mod message;
mod monitor;
mod param_commands;
mod param_file;
mod param_load;
mod param_text;
mod params;
mod program;
mod progress;
mod sample;
mod scope;
mod session;
mod signing;
mod step_by_step;
mod top_speed;
mod tune;

use std::io;
use std::process::ExitCode;

use clap::error::ContextKind;
use clap::error::ErrorKind::{DisplayHelpOnMissingArgumentOrSubcommand, UnknownArgument};
use clap::parser::ValueSource;
use clap::{Arg, CommandFactory, FromArgMatches};
use siskin_scope::printable;

use cli::{Cli, Command, KeyCommand};
use error::Error;
use link::Link;
use param_commands::Task;
use session::Session;
use signing::Signer;

/// Runs the command given by the program's arguments.
pub fn main() -> ExitCode {
    let cli = match parse() {
        Ok(cli) => cli,
        Err(mut e) if e.use_stderr() && e.kind() != DisplayHelpOnMissingArgumentOrSubcommand => {
            // The most similar name may be that of another board. All of them are listed anyway.
            e.remove(ContextKind::SuggestedValue);
            eprintln!("siskin: {}", printable::line(&one_line(&e.to_string())));
            return ExitCode::from(2);
        }
        // The help, which is also what no argument at all gets, or the version.
        Err(e) => e.exit(),
    };
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            let code = e.exit_code();
            if code != ExitCode::SUCCESS {
                eprintln!("siskin: {}", printable::lines(&e.to_string()));
            }
            code
        }
    }
}

/// Commands that work without an ESC, and which of the options that select one they do not take.
const WITHOUT_ESC: [(&str, &[&str]); 5] = [
    ("decode", &["connect", "system", "component", "sign-key"]),
    // --component selects one of several ESCs in a file.
    ("budget", &["connect", "system", "sign-key"]),
    ("tune", &["connect", "system", "sign-key"]),
    ("image", &["connect", "system", "component", "sign-key"]),
    ("flash", &["connect", "system", "component", "sign-key"]),
];

/// Parses the arguments; options a command does not take are hidden in its help and refused.
fn parse() -> Result<Cli, clap::Error> {
    let refusal = |name: &str, id: &str| format!("'{name}' needs no ESC: leave out --{id}");
    let mut command = Cli::command();
    for (name, idle) in WITHOUT_ESC {
        // An option of the subcommand shadows the global one.
        let own = idle.iter().map(|id| {
            let refused = move |_: &str| Err::<String, _>(refusal(name, id));
            Arg::new(*id).long(*id).hide(true).value_parser(refused)
        });
        command = command.mut_subcommand(name, |sub| sub.args(own));
    }
    let matches = command.try_get_matches_from_mut(std::env::args_os())?;
    for (name, idle) in WITHOUT_ESC {
        let given = |id: &&&str| matches.value_source(id) == Some(ValueSource::CommandLine);
        if matches.subcommand_name() == Some(name)
            && let Some(id) = idle.iter().find(given)
        {
            return Err(command.error(UnknownArgument, refusal(name, id)));
        }
    }
    Cli::from_arg_matches(&matches)
}

fn run(cli: &Cli) -> Result<(), Error> {
    let mut out = io::stdout().lock();
    let mut complaints = io::stderr().lock();
    let find = || {
        let signer = cli.sign_key.as_deref().map(Signer::open).transpose()?;
        let link = Link::open(&cli.connect)?;
        Session::find(link, (cli.system, cli.component), signer)
    };
    match &cli.command {
        Command::Params(command) => {
            let task = Task::check(command, &mut complaints)?;
            task.run(&mut find()?, &mut out, &mut complaints)
        }
        Command::Check { json } => check::run(&mut find()?, *json, &mut out),
        Command::Identify { keep, json } => identify::run(&mut find()?, (*keep, *json), &mut out),
        Command::Key(KeyCommand::New { file, passphrase }) => key::new(file, *passphrase, &mut out),
        Command::Key(KeyCommand::Set { file }) => {
            let signer = Signer::open(file)?;
            key::set(&mut find()?, signer, file, &mut out)
        }
        Command::Key(KeyCommand::Remove) => {
            key::check_remove(cli.sign_key.as_deref())?;
            key::remove(&mut find()?, &mut out)
        }
        Command::Faults(args) => faults::run(&mut find()?, args, &mut out),
        Command::Decode(args) => decode::run(&args.capture, &args.options, &mut out),
        Command::Budget(args) => budget::run(args, cli.component, &mut out),
        Command::Tune(args) => tune::run(args, cli.component, &mut out),
        Command::Image(args) => image::run(args, &mut out),
        Command::Flash(args) => flash::run(args, &mut out),
        Command::Scope(args) => scope::run(find()?, args, cli.component, &mut out),
        Command::Monitor(args) => monitor::run(&mut find()?, args, &mut out, &mut complaints),
    }
}

/// Returns the argument parser's error and hint on one line, without the usage that follows.
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
