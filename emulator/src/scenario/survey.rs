//! The results of many runs: what held in all of them, and the worst run of each expectation.

use std::collections::BTreeMap;

use serde::Serialize;
use xxhash_rust::xxh3::Xxh3;

use super::judge::Verdict;
use super::outcome::exit_status;
use super::place::Place;
use super::run::Run;
use crate::summary::Report;

/// Number of failed runs listed individually.
const LISTED: usize = 20;

/// The summary of several runs.
#[derive(Clone, Debug, Serialize)]
pub struct Survey {
    /// Number of runs.
    pub runs: usize,
    /// Runs left out after an interrupt.
    #[serde(skip_serializing_if = "is_zero")]
    pub left_out: usize,
    /// Runs in which an expectation failed.
    pub failed: usize,
    /// Further runs, which the ESC or the plant refused.
    #[serde(skip_serializing_if = "is_zero")]
    pub refused: usize,
    /// Faults that turned the bridge off, each with its number of runs.
    pub faults: BTreeMap<&'static str, usize>,
    /// What was wrong while the motor went on, each with its number of runs.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub warnings: BTreeMap<&'static str, usize>,
    /// Simulated time of all runs, s.
    pub sim_s: f64,
    /// Wall time, s.
    pub wall_s: f64,
    /// Simulated seconds per wall second.
    pub sim_per_wall: Option<f64>,
    /// Control periods of all runs.
    pub steps: u64,
    /// Hash over the trace hashes of all runs in order, however they ran in parallel.
    pub trace_hash: String,
    /// The expectations of each run.
    pub expectations: Vec<Expected>,
    /// The first runs that failed.
    pub failures: Vec<Failure>,
    /// The first runs that were refused.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub refusals: Vec<Refusal>,
}

/// A run that the ESC or the plant refused.
#[derive(Clone, Debug, Serialize)]
pub struct Refusal {
    /// Which run.
    #[serde(rename = "where")]
    pub place: Place,
    /// The options that reproduce this run alone.
    pub options: String,
    /// Why.
    pub error: String,
}

/// An expectation over all runs.
#[derive(Clone, Debug, Serialize)]
pub struct Expected {
    /// The window's name.
    pub window: String,
    /// The figure's key.
    pub key: String,
    /// Its required value.
    pub wanted: String,
    /// Runs that missed it.
    pub failed: usize,
    /// The worst figure: of the first run that comes closest to failing, or fails by the most.
    pub worst: Option<f64>,
    /// The run with the worst figure.
    #[serde(rename = "where")]
    pub place: Place,
    /// The options that reproduce this run alone.
    pub options: String,
    #[serde(skip)]
    slack: f64,
}

/// A run that failed.
#[derive(Clone, Debug, Serialize)]
pub struct Failure {
    /// Which run.
    #[serde(rename = "where")]
    pub place: Place,
    /// The options that reproduce this run alone.
    pub options: String,
    /// Faults that turned the bridge off.
    pub faults: Vec<&'static str>,
    /// The expectations that failed.
    pub expectations: Vec<Verdict>,
}

impl Survey {
    /// Sums up these runs, in order.
    pub(super) fn of(runs: impl IntoIterator<Item = Run>, left_out: usize, wall_s: f64) -> Self {
        let mut survey = Self {
            runs: 0,
            left_out,
            failed: 0,
            refused: 0,
            faults: BTreeMap::new(),
            warnings: BTreeMap::new(),
            sim_s: 0.0,
            wall_s,
            sim_per_wall: None,
            steps: 0,
            trace_hash: String::new(),
            expectations: Vec::new(),
            failures: Vec::new(),
            refusals: Vec::new(),
        };
        let mut hash = Xxh3::new();
        for Run { place, result } in runs {
            match result {
                Ok(played) => {
                    hash.update(played.report.trace_hash.as_bytes());
                    survey.add(&place, &played.report, played.verdicts);
                }
                Err(error) => survey.refuse(place, error.to_string()),
            }
        }
        survey.trace_hash = format!("{:016x}", hash.digest());
        survey.sim_per_wall = (wall_s > 0.0).then(|| survey.sim_s / wall_s);
        survey
    }

    /// Returns true if every expectation held in every run, and none was refused.
    pub fn held(&self) -> bool {
        self.failed == 0 && self.refused == 0
    }

    /// Like [`Outcome::exit_status`](super::Outcome::exit_status).
    pub fn exit_status(&self) -> u8 {
        exit_status(self.left_out > 0, self.held())
    }

    fn refuse(&mut self, place: Place, error: String) {
        self.refused += 1;
        if self.refusals.len() < LISTED {
            self.refusals.push(Refusal {
                options: place.to_string(),
                place,
                error,
            });
        }
    }

    fn add(&mut self, place: &Place, report: &Report, verdicts: Vec<Verdict>) {
        self.runs += 1;
        for fault in report.faults.iter().flatten() {
            *self.faults.entry(fault).or_default() += 1;
        }
        for warning in &report.warnings {
            *self.warnings.entry(warning).or_default() += 1;
        }
        self.sim_s += report.sim_s;
        self.steps += report.steps;
        for (index, verdict) in verdicts.iter().enumerate() {
            match self.expectations.get_mut(index) {
                None => self.expectations.push(Expected::new(place, verdict)),
                Some(expected) => expected.add(place, verdict),
            }
        }
        let broken: Vec<_> = verdicts.into_iter().filter(Verdict::failed).collect();
        if broken.is_empty() {
            return;
        }
        self.failed += 1;
        if self.failures.len() < LISTED {
            self.failures.push(Failure {
                place: place.clone(),
                options: place.to_string(),
                faults: report.faults.clone().unwrap_or_default(),
                expectations: broken,
            });
        }
    }
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl Expected {
    fn new(place: &Place, verdict: &Verdict) -> Self {
        Self {
            window: verdict.window.clone(),
            key: verdict.key.clone(),
            wanted: verdict.wanted.clone(),
            failed: usize::from(verdict.failed()),
            worst: verdict.value,
            place: place.clone(),
            options: place.to_string(),
            slack: verdict.slack,
        }
    }

    fn add(&mut self, place: &Place, verdict: &Verdict) {
        self.failed += usize::from(verdict.failed());
        if verdict.slack < self.slack {
            self.slack = verdict.slack;
            self.worst = verdict.value;
            self.place = place.clone();
            self.options = place.to_string();
        }
    }
}
