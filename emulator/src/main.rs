//! The emulator's command line: one ESC in real time, scenarios offline, pictures of recordings.
#![forbid(unsafe_code)]

mod cli;
mod report;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use indicatif::ProgressBar;
use siskin_emulator::bench::Choice;
use siskin_emulator::flash::FileFlash;
use siskin_emulator::link::Endpoint;
use siskin_emulator::live::{self, Session};
use siskin_emulator::plot;
use siskin_emulator::reproduce;
use siskin_emulator::rig::Bench;
use siskin_emulator::scenario::{self, Plan};

use cli::{Cli, Command, Paper, PlotArgs, ReproduceArgs, RunArgs, ScenarioArgs};

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
        Some(Command::Plot(args)) => plot(&args),
    };
    match result {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
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
    let text = error.render().to_string();
    let what = text.lines().next().unwrap_or_default();
    let what = what.trim_start_matches("error: ");
    eprintln!("siskin-emulator: {what}; --help lists what there is");
    ExitCode::from(2)
}

fn run(args: RunArgs) -> Result<bool, String> {
    let line = |error: &dyn std::error::Error| error.to_string();
    let motor = Choice::Named(args.motor.clone()).motor();
    let load = Choice::Named(args.load.clone()).load();
    let (motor, load) = (
        motor.map_err(|error| line(&error))?,
        load.map_err(|error| line(&error))?,
    );
    if motor.inertia_kgm2 + load.inertia_kgm2 <= 0.0 {
        return Err(format!(
            "motor {} and load {}: neither has inertia; give one a J",
            args.motor, args.load
        ));
    }
    let session = Session {
        bench: Bench {
            motor,
            load,
            supply: args.bus,
            plant: args.plant,
            seed: args.seed,
            ..Bench::default()
        },
        mavlink: if args.mavlink.is_empty() {
            Endpoint::defaults()
        } else {
            args.mavlink.clone()
        },
        signal: args.signal.clone(),
        pace: args.speed,
        duration: args.duration.map(Duration::from_secs_f64),
        flash: storage(args.storage.as_deref())?,
        params: args.common.params(),
        record: args.common.record.clone(),
    };
    let report = live::run(session, |opened, device| {
        if let Some(warning) = opened.warning {
            eprintln!("siskin-emulator: {warning}");
        }
        if !args.common.json {
            // Where nobody reads it, the ESC runs all the same.
            let _ = report::print(&report::greeting(&args, opened, device));
        }
    });
    let report = report.map_err(|error| line(&error))?;
    report::print(&if args.common.json {
        report::json(&report)?
    } else {
        report::figures(&report)
    })?;
    Ok(true)
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

fn scenario(args: &ScenarioArgs) -> Result<bool, String> {
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
        let survey = plan.survey(|| bar.inc(1));
        bar.finish_and_clear();
        let survey = survey.map_err(line)?;
        report::print(&if args.common.json {
            report::json(&survey)?
        } else {
            report::survey(&survey)
        })?;
        return Ok(survey.held());
    }
    let outcome = plan.play().map_err(line)?;
    report::print(&if args.common.json {
        report::json(&outcome)?
    } else {
        report::figures(&outcome.report) + &report::verdicts(&outcome)
    })?;
    Ok(outcome.held())
}

fn reproduce(args: &ReproduceArgs) -> Result<bool, String> {
    let reproduction = match args.paper {
        Paper::Colton => reproduce::colton(),
    };
    report::print(&if args.json {
        report::json(&reproduction)?
    } else {
        reproduction.to_string()
    })?;
    Ok(true)
}

fn plot(args: &PlotArgs) -> Result<bool, String> {
    plot::plot(&args.record, &args.output).map_err(|error| error.to_string())?;
    Ok(true)
}
