//! The emulator's command line: one ESC in real time, scenarios offline, pictures of recordings.
#![forbid(unsafe_code)]

mod cli;
mod report;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use indicatif::ProgressBar;
use siskin_emulator::flash::FileFlash;
use siskin_emulator::interrupt;
use siskin_emulator::link::Endpoint;
use siskin_emulator::live::{self, Session};
use siskin_emulator::measure;
use siskin_emulator::plot;
use siskin_emulator::reproduce;
use siskin_emulator::scenario::{self, Plan};

use cli::{BenchArgs, Cli, Command, Paper, PlotArgs, ReproduceArgs, RunArgs, ScenarioArgs};

/// The status of what an interrupt has ended, as a shell has it.
const INTERRUPTED: u8 = 130;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return usage(&error),
    };
    let result = match cli.command {
        None => run(cli.run),
        Some(Command::Run(args)) => run(args),
        Some(Command::Scenario(args)) => scenario(&args),
        Some(Command::Reproduce(args)) => reproduce(&args),
        Some(Command::Bench(args)) => bench(&args),
        Some(Command::Plot(args)) => plot(&args),
    };
    match result {
        Ok(status) => status,
        Err(line) => {
            eprintln!("siskin-emulator: {line}");
            ExitCode::from(2)
        }
    }
}

/// Help and version as clap prints them; what is wrong in one line.
fn usage(error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        // Nobody to tell where standard output is closed.
        let _ = error.print();
        return ExitCode::SUCCESS;
    }
    let what = one_line(&error.to_string());
    eprintln!("siskin-emulator: {what}; --help lists what there is");
    ExitCode::from(2)
}

/// The argument parser's complaint and its hint on one line, without the usage that follows.
fn one_line(message: &str) -> String {
    let lines = message.lines().map(str::trim);
    let said = lines.take_while(|line| !line.starts_with("Usage:"));
    let said = said.filter(|line| !line.is_empty() && !line.starts_with("For more information"));
    let words = said.collect::<Vec<_>>().join(" ");
    words.trim_start_matches("error: ").to_owned()
}

fn run(args: RunArgs) -> Result<ExitCode, String> {
    let line = |error: &dyn std::error::Error| error.to_string();
    let standing = args.standing().map_err(|error| line(&error))?;
    let mut params = standing.params.clone();
    params.extend(args.common.params());
    let session = Session {
        bench: standing.bench.clone(),
        mavlink: if args.mavlink.is_empty() {
            Endpoint::defaults()
        } else {
            args.mavlink.clone()
        },
        signal: args.signal.clone(),
        pace: args.speed,
        duration: args.duration.map(Duration::from_secs_f64),
        flash: storage(args.storage.as_deref())?,
        params,
        record: args.common.record.clone(),
    };
    let report = live::run(session, |opened, device| {
        if let Some(warning) = opened.warning {
            eprintln!("siskin-emulator: {warning}");
        }
        if !args.common.json {
            // Where nobody reads it, the ESC runs all the same.
            let _ = report::print(&report::greeting(&args, &standing, opened, device));
        }
    });
    let report = report.map_err(|error| line(&error))?;
    report::print(&if args.common.json {
        report::json(&report)?
    } else {
        report::figures(&report)
    })?;
    Ok(ExitCode::SUCCESS)
}

/// The flash behind `--storage`, by default in the user's state folder.
fn storage(given: Option<&Path>) -> Result<FileFlash, String> {
    match given {
        Some(path) if path == Path::new("none") => Ok(FileFlash::in_memory()),
        Some(path) => FileFlash::open(path).map_err(|error| error.to_string()),
        None => {
            let Some(path) = state_file() else {
                eprintln!("siskin-emulator: no home folder: settings are kept until the end only");
                return Ok(FileFlash::in_memory());
            };
            FileFlash::open(&path).or_else(|error| {
                eprintln!("siskin-emulator: {error}; settings are kept until the end only");
                Ok(FileFlash::in_memory())
            })
        }
    }
}

/// Where settings stay between runs: the state folder of the XDG base directories.
fn state_file() -> Option<PathBuf> {
    let absolute = |name| {
        let path = PathBuf::from(std::env::var_os(name)?);
        path.is_absolute().then_some(path)
    };
    let folder =
        absolute("XDG_STATE_HOME").or_else(|| Some(absolute("HOME")?.join(".local/state")));
    Some(folder?.join("siskin/esc.flash"))
}

fn scenario(args: &ScenarioArgs) -> Result<ExitCode, String> {
    let options = scenario::Options {
        seeds: args.seeds.clone().or(args.seed.map(|seed| seed..=seed)),
        set: args.keys(),
        record: args.common.record.clone(),
    };
    let line = |error| format!("{}: {error}", args.file.display());
    let plan = Plan::read(&args.file, &options).map_err(line)?;
    if args.seeds.is_some() || plan.runs() > 1 {
        // On standard error, and nothing where that is no terminal.
        let bar = ProgressBar::new(plan.runs() as u64);
        let stop = interrupt::flag();
        let stop = stop.map_err(|error| format!("cannot listen for interrupts: {error}"))?;
        let survey = plan.survey(&stop, || bar.inc(1));
        bar.finish_and_clear();
        let survey = survey.map_err(line)?;
        report::print(&if args.common.json {
            report::json(&survey)?
        } else {
            report::survey(&survey)
        })?;
        return Ok(match survey.left_out {
            0 => verdict(survey.held()),
            _ => ExitCode::from(INTERRUPTED),
        });
    }
    let outcome = plan.play().map_err(line)?;
    report::print(&if args.common.json {
        report::json(&outcome)?
    } else {
        report::figures(&outcome.report) + &report::verdicts(&outcome)
    })?;
    Ok(verdict(outcome.held()))
}

/// The status of a scenario whose expectations held, or did not.
fn verdict(held: bool) -> ExitCode {
    if held {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(1)
    }
}

fn reproduce(args: &ReproduceArgs) -> Result<ExitCode, String> {
    let line = |error: plot::PlotError| error.to_string();
    if let Some(folder) = &args.output {
        // It takes long enough not to find out at its end.
        plot::chart::prepare(folder).map_err(line)?;
    }
    let reproduction = match args.paper {
        Paper::Bosso => reproduce::bosso(),
        Paper::Colton => reproduce::colton(),
    };
    if let Some(folder) = &args.output {
        plot::chart::draw(&reproduction.figures, folder).map_err(line)?;
    }
    report::print(&if args.json {
        report::json(&reproduction)?
    } else {
        reproduction.to_string()
    })?;
    Ok(ExitCode::SUCCESS)
}

fn bench(args: &BenchArgs) -> Result<ExitCode, String> {
    let figures = measure::measure().map_err(|error| error.reason.to_owned())?;
    report::print(&if args.json {
        report::json(&figures)?
    } else {
        figures.to_string()
    })?;
    Ok(ExitCode::SUCCESS)
}

fn plot(args: &PlotArgs) -> Result<ExitCode, String> {
    plot::plot(&args.record, &args.output).map_err(|error| error.to_string())?;
    Ok(ExitCode::SUCCESS)
}
