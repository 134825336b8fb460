//! The virtual board's command line: runs the linked image in real time, with the emulator's options.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use serde::Serialize;
use siskin_emulator::device::Start;
use siskin_emulator::interrupt;
use siskin_emulator::live::{self, Opened};
use siskin_emulator::options::{self, RunArgs, ScenarioArgs, Speed};
use siskin_emulator::report;
use siskin_emulator::scenario::{Outcome, Row, Table};
use siskin_emulator::summary::Report;
use siskin_vboard::image::Image;
use siskin_vboard::load::Figures;
use siskin_vboard::machine::VirtualBoard;

/// Run a board's image on a simulated B-G431B-ESC1 that drives a simulated motor.
#[derive(Debug, Parser)]
#[command(name = "siskin-vboard", version)]
struct Cli {
    /// Linked image, an ELF file. It has no command line: what --param, --preset and --bench set is
    /// written to its flash before it starts, and stored with the rest whenever it stores
    image: PathBuf,
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: RunArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Play a scenario from a file, offline; its signals must be throttle, not speed or current
    Scenario(ScenarioArgs),
}

/// What is printed at the end as JSON.
#[derive(Serialize)]
struct Summary {
    #[serde(flatten)]
    report: Report,
    processor: Option<Figures>,
}

/// The same for a scenario.
#[derive(Serialize)]
struct Played {
    #[serde(flatten)]
    outcome: Outcome,
    processor: Option<Figures>,
}

/// The program, as its complaints begin.
const PROGRAM: &str = "siskin-vboard";

fn complain(line: &str) {
    options::complain(PROGRAM, line);
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return options::usage(PROGRAM, &error),
    };
    let ended = match &cli.command {
        None => run(&cli),
        Some(Command::Scenario(args)) => scenario(&cli.image, args),
    };
    match ended {
        Ok(status) => status,
        Err(line) => {
            complain(&line);
            ExitCode::from(2)
        }
    }
}

fn run(cli: &Cli) -> Result<ExitCode, String> {
    let args = &cli.run;
    let line = |error: &dyn std::error::Error| error.to_string();
    let image = Image::read(&cli.image).map_err(|error| line(&error))?;
    if args.escs > 1 || args.speed == Speed::Lockstep {
        return Err(
            "--escs and --speed lockstep are the emulator's; run one board for each ESC".to_owned(),
        );
    }
    let standing = args.standing().map_err(|error| line(&error))?;
    let (session, warning) = args.session(&standing).map_err(|error| line(&error))?;
    warning.as_deref().into_iter().for_each(complain);
    let start = |starts: Vec<Start>| {
        let start = starts.into_iter().next().unwrap_or_default();
        let (board, warning) = VirtualBoard::new(&image, start)?;
        Ok((board, warning.into_iter().collect()))
    };
    let opened = |opened: &Opened, board: &VirtualBoard| {
        let what = "image on a virtual board";
        report::opened(what, args, &standing, opened, board.params());
    };
    let ended = live::run(session, start, opened, complain);
    let (report, mut board) = ended.map_err(|error| line(&error))?;
    let processor = board.figures();
    let text = if args.common.json {
        report::json(&Summary { report, processor })?
    } else {
        report::figures(&report) + &of_processor(processor)
    };
    report::print(&text)?;
    Ok(ExitCode::SUCCESS)
}

fn scenario(image: &Path, args: &ScenarioArgs) -> Result<ExitCode, String> {
    let image = Image::read(image).map_err(|error| error.to_string())?;
    let line = |error| format!("{}: {error}", args.file.display());
    let plan = args.plan().map_err(line)?;
    if args.seeds.is_some() || plan.runs() > 1 {
        let what = "the scenario has several runs; give --seed N and --set KEY=VALUE for one";
        return Err(format!("{}: {what}", args.file.display()));
    }
    let stop = interrupt::flag();
    let stop = stop.map_err(|error| format!("cannot listen for interrupts: {error}"))?;
    let mut processor = None;
    let start = |start| Ok(VirtualBoard::new(&image, start)?);
    let played = plan.play_on(&stop, start, |mut board: VirtualBoard| {
        processor = board.figures();
    });
    let outcome = played.map_err(line)?;
    if let Some(path) = &args.table {
        let row = Row::of(&outcome.place, &outcome.report, &outcome.expectations);
        let written = Table::create(path).and_then(|table| table.finish(&[row]));
        written.map_err(|error| error.to_string())?;
    }
    let status = outcome.exit_status();
    let text = if args.common.json {
        report::json(&Played { outcome, processor })?
    } else {
        let of_outcome = report::figures(&outcome.report) + &report::verdicts(&outcome);
        of_outcome + &of_processor(processor)
    };
    report::print(&text)?;
    Ok(ExitCode::from(status))
}

fn of_processor(figures: Option<Figures>) -> String {
    figures.map_or_else(String::new, |figures| figures.to_string())
}
