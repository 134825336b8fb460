//! Runs from a file, offline: a bench, signals, measuring windows and expectations.
//!
//! With a table of swept keys, or several seeds, a file stands for many runs: every combination for every seed. They
//! run in parallel and are summed up in one [`Survey`]. Keys are dotted, array entries count from 0, and a drawn value
//! depends on seed and key alone:
//!
//! ```toml
//! [sweep]
//! "params.MOT_R_MOHM" = [75.6, 108.0, 140.4]
//! "signal.0.rpm" = [3000.0, 6000.0]
//!
//! [random]
//! "bench.initial_angle_deg" = [-180.0, 180.0]
//! "bench.delay_periods" = { of = [0.0, 0.5, 1.0] }
//! ```
//!
//! `base` in `[bench]` names a bench of the library or a similar file: its `[bench]` and `[params]` apply where the
//! scenario says nothing. Paths in a file are relative to the file's folder, or else, those of a bench, motor, load or
//! supply, to the working directory.
//!
//! An expectation of the window `run` covers the whole run; its `faults` is the number of different faults.

mod course;
mod courses;
mod error;
mod fault;
mod file;
mod judge;
mod lines;
mod outcome;
mod place;
mod play;
mod run;
mod script;
mod signal;
mod stand;
mod survey;
mod table;
mod vary;
mod wire;

use std::fs::File;
use std::io::{self, Read};
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use rayon::prelude::*;

use crate::device::Start;
use crate::machine::Machine;
use courses::Courses;
pub use error::ScenarioError;
pub use fault::from_text as fault;
pub use judge::Verdict;
pub use outcome::Outcome;
pub use place::Place;
use play::Played;
pub use run::Run;
pub use script::{Ending, Script};
pub use stand::{Standing, stand};
pub use survey::{Expected, Failure, Refusal, Survey};
pub use table::{Cell, Row, Table};
use vary::{Case, Variations};
pub use wire::Wire as ThrottleSignal;
pub(crate) use wire::bits as dshot_bits;

/// The longest file, bytes: a hundred times the usual length. An entry takes a few KB while it is parsed.
const TEXT_MAX: u64 = 1_000_000;

/// Changes to a scenario from the command line.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Seeds that replace the file's.
    pub seeds: Option<RangeInclusive<u64>>,
    /// Keys of the file with a fixed value, in place of what sweeps or draws it.
    pub set: Vec<(String, toml::Value)>,
    /// Where each period of the only run is recorded.
    pub record: Option<PathBuf>,
}

/// A scenario that has been read and checked.
pub struct Plan {
    variations: Variations,
    courses: Courses,
    record: Option<PathBuf>,
}

impl Plan {
    /// Reads the scenario in the file at `path`.
    ///
    /// # Errors
    /// Any [`ScenarioError`] that shows before a run; that of the first run to have one.
    pub fn read(path: &Path, options: &Options) -> Result<Self, ScenarioError> {
        let text = text(path).map_err(ScenarioError::Read)?;
        let in_file = |error: ScenarioError| error.in_file(&text, &options.set);
        let folder = path.parent().unwrap_or(Path::new(""));
        let variations = Variations::read(&text, &options.set, options.seeds.clone(), folder);
        let plan = Self {
            variations: variations.map_err(in_file)?,
            courses: Courses::in_folder(folder),
            record: options.record.clone(),
        };
        if plan.record.is_some() && plan.runs() > 1 {
            return Err(ScenarioError::RecordsOne(plan.runs()));
        }
        let problems = (0..plan.runs()).into_par_iter();
        match problems.find_map_first(|index| plan.check(index).err()) {
            Some(error) => Err(in_file(error)),
            None => Ok(plan),
        }
    }

    /// Returns the number of runs that it stands for.
    pub fn runs(&self) -> usize {
        self.variations.runs()
    }

    /// Plays the only run, or the first of several, to its end or until `stop` is set; what was played until then is
    /// kept.
    ///
    /// # Errors
    /// Any [`ScenarioError`] that shows in the run.
    pub fn play(&self, stop: &AtomicBool) -> Result<Outcome, ScenarioError> {
        let (place, played) = self.play_one(0, stop)?;
        Ok(Outcome::new(played, place))
    }

    /// Plays the only run, or the first of several, on another machine, made by `start` and passed to `ended` at the
    /// end or once `stop` is set.
    ///
    /// # Errors
    /// Any [`ScenarioError`] that shows in the run, and a signal that bypasses the wire.
    pub fn play_on<M: Machine>(
        &self,
        stop: &AtomicBool,
        start: impl FnOnce(Start) -> Result<(M, Option<&'static str>), ScenarioError>,
        ended: impl FnOnce(M),
    ) -> Result<Outcome, ScenarioError> {
        let Case { place, scenario } = self.case(0)?;
        match play::play_on(&scenario, self.record.as_deref(), stop, start, ended) {
            Ok(played) => Ok(Outcome::new(played, place)),
            Err(error) => Err(place.blame(error)),
        }
    }

    /// Plays all runs on all processors; calls `each` after each of them, and at the end `look` for each in run order.
    /// Once `stop` is set no run begins or continues: the survey covers those played to their end, and those that were
    /// refused.
    ///
    /// # Errors
    /// The first run's, if all of them are refused.
    pub fn survey(
        &self,
        stop: &AtomicBool,
        each: impl Fn() + Sync,
        look: impl FnMut(&Run),
    ) -> Result<Survey, ScenarioError> {
        let began = Instant::now();
        let runs = self.play_each(0..self.runs(), stop, each)?;
        let left_out = self.runs() - runs.len();
        runs.iter().for_each(look);
        let runs = run::any_played(runs)?;
        Ok(Survey::of(runs, left_out, began.elapsed().as_secs_f64()))
    }

    /// Plays some of the runs on all processors and returns a survey's row for each, in order. Once `stop` is set no
    /// run begins or continues, and theirs are left out.
    ///
    /// # Errors
    /// The first run's, if these are all, and each of them is refused.
    pub fn rows(&self, runs: Range<usize>, stop: &AtomicBool) -> Result<Vec<Row>, ScenarioError> {
        let are_all = runs == (0..self.runs());
        let mut runs = self.play_each(runs, stop, || ())?;
        if are_all {
            runs = run::any_played(runs)?;
        }
        Ok(runs.iter().map(Run::row).collect())
    }

    fn play_each(
        &self,
        runs: Range<usize>,
        stop: &AtomicBool,
        each: impl Fn() + Sync,
    ) -> Result<Vec<Run>, ScenarioError> {
        let runs = runs.into_par_iter().filter_map(|index| {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            let run = self.run(index, stop);
            if matches!(&run, Ok(run) if run.was_interrupted()) {
                return None;
            }
            each();
            Some(run)
        });
        runs.collect()
    }

    fn run(&self, index: usize, stop: &AtomicBool) -> Result<Run, ScenarioError> {
        let Case { place, scenario } = self.case(index)?;
        let result = play::play(&scenario, self.record.as_deref(), stop);
        Run::of(place, result)
    }

    fn check(&self, index: usize) -> Result<(), ScenarioError> {
        let Case { place, scenario } = self.case(index)?;
        play::check(&scenario).map_err(|error| place.blame(error))
    }

    fn play_one(&self, index: usize, stop: &AtomicBool) -> Result<(Place, Played), ScenarioError> {
        let Case { place, scenario } = self.case(index)?;
        match play::play(&scenario, self.record.as_deref(), stop) {
            Ok(played) => Ok((place, played)),
            Err(error) => Err(place.blame(error)),
        }
    }

    fn case(&self, index: usize) -> Result<Case, ScenarioError> {
        let mut case = self.variations.case(index)?;
        let filled = self.courses.fill(&mut case.scenario);
        filled.map_err(|error| case.place.blame(error))?;
        Ok(case)
    }
}

/// Reads the text of a scenario's file.
fn text(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    let length = File::open(path)?
        .take(TEXT_MAX + 1)
        .read_to_string(&mut text)?;
    if length as u64 > TEXT_MAX {
        let what = format!(
            "a scenario of more than {TEXT_MAX} bytes is not taken; a long course of a signal goes into a file \
             of its own, by shape = \"file\""
        );
        return Err(io::Error::other(what));
    }
    Ok(text)
}

#[cfg(test)]
mod tests;
