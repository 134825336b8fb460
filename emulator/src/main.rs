//! The emulator's command line: ESCs in real time or in lockstep, scenarios offline, pictures of recordings.
#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use siskin_emulator::interrupt;
use siskin_emulator::live::{self, Opened};
use siskin_emulator::lockstep;
use siskin_emulator::matrix::Matrix;
use siskin_emulator::measure;
use siskin_emulator::options::{self, RunArgs, ScenarioArgs, Speed};
use siskin_emulator::plot;
use siskin_emulator::rack::Rack;
use siskin_emulator::report;
use siskin_emulator::reproduce;
use siskin_emulator::scenario::{Row, Run, Table};
use siskin_emulator::web::WebAddress;

use cli::{BenchArgs, Cli, Command, MatrixArgs, Paper, PlotArgs, ReproduceArgs};

/// Progress of a sweep and the time it still takes.
const PROGRESS: &str = "{wide_bar} {pos} of {len} runs, {eta} to go";

/// The program, as its complaints begin.
const PROGRAM: &str = "siskin-emulator";

fn complain(line: &str) {
    options::complain(PROGRAM, line);
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return options::usage(PROGRAM, &error),
    };
    let result = match cli.command {
        None => run(cli.run),
        Some(Command::Run(args)) => run(args),
        Some(Command::Scenario(args)) => scenario(&args),
        Some(Command::Reproduce(args)) => reproduce(&args),
        Some(Command::Bench(args)) => bench(&args),
        Some(Command::Matrix(args)) => matrix(&args),
        Some(Command::Plot(args)) => plot(&args),
    };
    match result {
        Ok(status) => status,
        Err(line) => {
            complain(&line);
            ExitCode::from(2)
        }
    }
}

fn run(args: RunArgs) -> Result<ExitCode, String> {
    let line = |error: &dyn std::error::Error| error.to_string();
    if args.speed == Speed::Lockstep && matches!(args.web, Some(WebAddress::At(_))) {
        return Err("--web: no page is served in lockstep; leave it out".to_owned());
    }
    let standing = args.standing().map_err(|error| line(&error))?;
    let (session, warning) = args.session(&standing).map_err(|error| line(&error))?;
    warning.as_deref().into_iter().for_each(complain);
    let opened = |opened: &Opened, rack: &Rack| {
        let params = rack.escs()[0].esc().params();
        report::opened("emulated", &args, &standing, opened, params);
    };
    let report = match args.speed {
        Speed::Paced(_) => {
            let start = |starts| Ok(Rack::start(starts)?);
            live::run(session, start, opened, complain).map(|(report, _)| report)
        }
        Speed::Lockstep => lockstep::serve(session, opened, complain),
    };
    let report = report.map_err(|error| line(&error))?;
    report::print(&if args.common.json {
        report::json(&report)?
    } else {
        report::figures(&report)
    })?;
    Ok(ExitCode::SUCCESS)
}

fn scenario(args: &ScenarioArgs) -> Result<ExitCode, String> {
    let line = |error| format!("{}: {error}", args.file.display());
    let plan = args.plan().map_err(line)?;
    let stop = interrupt::flag();
    let stop = stop.map_err(|error| format!("cannot listen for interrupts: {error}"))?;
    let table = args.table.as_deref().map(Table::create).transpose();
    let table = table.map_err(|error| error.to_string())?;
    let wanted = table.is_some();
    let finish = |rows: &[Row]| match table {
        Some(table) => table.finish(rows).map_err(|error| error.to_string()),
        None => Ok(()),
    };
    if args.seeds.is_some() || plan.runs() > 1 {
        // On standard error, and hidden if that is no terminal.
        let style = ProgressStyle::with_template(PROGRESS).map_err(|error| error.to_string())?;
        let bar = ProgressBar::new(plan.runs() as u64).with_style(style);
        let mut rows = Vec::new();
        let look = |run: &Run| {
            if wanted {
                rows.push(run.row());
            }
        };
        let survey = plan.survey(&stop, || bar.inc(1), look);
        bar.finish_and_clear();
        // Where all are refused, the table says why each was.
        finish(&rows)?;
        let survey = survey.map_err(line)?;
        report::print(&if args.common.json {
            report::json(&survey)?
        } else {
            report::survey(&survey)
        })?;
        return Ok(ExitCode::from(survey.exit_status()));
    }
    let outcome = plan.play(&stop).map_err(line)?;
    finish(&[Row::of(
        &outcome.place,
        &outcome.report,
        &outcome.expectations,
    )])?;
    report::print(&if args.common.json {
        report::json(&outcome)?
    } else {
        report::figures(&outcome.report) + &report::verdicts(&outcome)
    })?;
    Ok(ExitCode::from(outcome.exit_status()))
}

fn reproduce(args: &ReproduceArgs) -> Result<ExitCode, String> {
    let line = |error: plot::PlotError| error.to_string();
    if let Some(folder) = &args.output {
        // It takes too long to find out only at the end.
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

fn matrix(args: &MatrixArgs) -> Result<ExitCode, String> {
    let matrix = Matrix::play(|_, _, _| true).map_err(|error| error.to_string())?;
    if let Some(picture) = &args.output {
        let drawn = matrix.grid().draw_to(picture);
        drawn.map_err(|error| error.to_string())?;
    }
    report::print(&if args.json {
        report::json(&matrix)?
    } else {
        matrix.to_string()
    })?;
    Ok(ExitCode::from(u8::from(matrix.failed().next().is_some())))
}

fn plot(args: &PlotArgs) -> Result<ExitCode, String> {
    plot::plot(&args.record, &args.output).map_err(|error| error.to_string())?;
    Ok(ExitCode::SUCCESS)
}
