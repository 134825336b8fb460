//! Why a scenario cannot run.

use thiserror::Error;
use toml::Value;

use super::lines::line_of;
use crate::bench::BenchError;
use crate::device::StartError;
use crate::machine::Stopped;
use crate::watch::WatchError;

/// Why a scenario cannot run; one line without the file's name.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("{0}")]
    Read(std::io::Error),
    /// It is not a scenario.
    #[error("{0}")]
    Syntax(String),
    /// Something that cannot be put on the bench.
    #[error("{key}: {0}", key = .0.key())]
    Bench(#[from] BenchError),
    /// A quantity out of range.
    #[error("{key} = {value} is out of range; give {least} to {most}")]
    Range {
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
        /// The least.
        least: f64,
        /// The greatest.
        most: f64,
    },
    /// A delay that no board has.
    #[error("bench.delay_periods = {0}; give 0, 0.5 or 1")]
    Delay(f64),
    /// An expectation of an unknown window, of an unknown figure, or of nothing.
    #[error("the expectation of {window}.{key} {problem}")]
    Expectation {
        /// The window's name.
        window: String,
        /// The figure's key.
        key: String,
        /// What is wrong.
        problem: &'static str,
    },
    /// A key whose value makes no sense.
    #[error("{key}: {problem}")]
    Key {
        /// The dotted key.
        key: String,
        /// What is wrong.
        problem: String,
    },
    /// What is wrong, and where in the file.
    #[error("line {line}: {error}")]
    Line {
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        error: Box<ScenarioError>,
    },
    /// More combinations and seeds than anyone waits for.
    #[error("{runs} runs; at most {most} at once")]
    Runs {
        /// How many there would be.
        runs: u128,
        /// How many there may be.
        most: u128,
    },
    /// A recording of several runs.
    #[error("--record takes one run and these are {0}; pick one with --seed and --set KEY=VALUE")]
    RecordsOne(usize),
    /// What is wrong with one of several runs.
    #[error("{error} (with {place})")]
    Case {
        /// What is wrong.
        error: Box<ScenarioError>,
        /// The options that reproduce this run.
        place: String,
    },
    /// The ESC does not start.
    #[error("{0}")]
    Start(#[from] StartError),
    /// Another machine cannot start or go on.
    #[error("{0}")]
    Stopped(#[from] Stopped),
    /// The plant or the recording.
    #[error("{0}")]
    Watch(#[from] WatchError),
}

impl ScenarioError {
    /// Creates the error of a key whose value makes no sense.
    pub(super) fn of_key(key: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Key {
            key: key.into(),
            problem: problem.into(),
        }
    }

    /// Adds the line of its key in the file, if the value is from the file and not from keys set on
    /// the command line.
    pub(super) fn in_file(self, text: &str, set: &[(String, Value)]) -> Self {
        let line = self.key().and_then(|key| line_of(text, &key, set));
        match line {
            Some(line) => Self::Line {
                line,
                error: Box::new(self),
            },
            None => self,
        }
    }

    /// Returns the dotted key that it is about.
    fn key(&self) -> Option<String> {
        match self {
            Self::Bench(error) => Some(error.key()),
            // What motor and load give together is attributed to the motor.
            Self::Range { key, .. } if !key.starts_with("bench.") => Some("bench.motor".to_owned()),
            Self::Range { key, .. } => Some((*key).to_owned()),
            Self::Delay(_) => Some("bench.delay_periods".to_owned()),
            Self::Key { key, .. } => Some(key.clone()),
            Self::Case { error, .. } => error.key(),
            Self::Read(_)
            | Self::Syntax(_)
            | Self::Expectation { .. }
            | Self::Line { .. }
            | Self::Runs { .. }
            | Self::RecordsOne(_)
            | Self::Start(_)
            | Self::Stopped(_)
            | Self::Watch(_) => None,
        }
    }
}
