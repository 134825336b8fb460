//! Why a scenario cannot run.

use thiserror::Error;

use crate::bench::BenchError;
use crate::device::StartError;
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
    /// Something that cannot stand on the bench.
    #[error("bench: {0}")]
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
    /// A parameter that there is not or that is out of range.
    #[error("params: {0}")]
    Parameter(String),
    /// A signal that makes no sense.
    #[error("the signal at {at_s} s {problem}")]
    Signal {
        /// Its time.
        at_s: f64,
        /// What is wrong.
        problem: &'static str,
    },
    /// Signals out of order.
    #[error("the signal at {0} s stands after a later one; put them in order")]
    Order(f64),
    /// A window without time.
    #[error("the window {0} has no time between t0_s and t1_s")]
    Window(String),
    /// Two windows of one name.
    #[error("there are two windows {0}; give each its own name")]
    Twice(String),
    /// An expectation of no window, of no figure, or of nothing.
    #[error("the expectation of {window}.{key} {problem}")]
    Expectation {
        /// The window's name.
        window: String,
        /// The figure's key.
        key: String,
        /// What is wrong.
        problem: &'static str,
    },
    /// A key that cannot be set, swept or drawn.
    #[error("{key}: {problem}")]
    Key {
        /// The dotted key.
        key: String,
        /// What is wrong.
        problem: String,
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
        /// The options that make this run.
        place: String,
    },
    /// The ESC does not start.
    #[error("{0}")]
    Start(#[from] StartError),
    /// The plant or the recording.
    #[error("{0}")]
    Watch(#[from] WatchError),
}
