//! Scenarios played by a Python program.

use std::num::NonZero;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::thread;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rayon::ThreadPoolBuilder;
use siskin_emulator::scenario::{self, Options, Row, Table};

use crate::convert::{cells, row, to_table};
use crate::{Error, interrupt};

/// The most threads per core: a run that waits for nothing gains nothing by more.
const THREADS_PER_CORE: usize = 4;

/// A scenario that has been read and validated.
#[pyclass(frozen, module = "siskin._siskin")]
pub(crate) struct Plan {
    plan: scenario::Plan,
    path: PathBuf,
}

impl Plan {
    fn wrong(&self, error: impl ToString) -> PyErr {
        wrong(&self.path, error)
    }
}

/// Makes an error with the text that the program prints.
fn wrong(path: &std::path::Path, error: impl ToString) -> PyErr {
    Error::new_err(format!("{}: {}", path.display(), error.to_string()))
}

#[pymethods]
impl Plan {
    #[new]
    #[pyo3(signature = (path, seeds, given, record))]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        seeds: Option<(u64, u64)>,
        given: &Bound<'_, PyDict>,
        record: Option<PathBuf>,
    ) -> PyResult<Self> {
        let options = Options {
            seeds: seeds.map(|(first, last)| first..=last),
            set: to_table(given)?.into_iter().collect(),
            record,
        };
        // The threads shared by a whole process are lost in one that is forked.
        let pool = ThreadPoolBuilder::new().build();
        let pool = pool.map_err(|error| wrong(&path, error))?;
        let plan = py.detach(|| pool.install(|| scenario::Plan::read(&path, &options)));
        match plan {
            Ok(plan) => Ok(Self { plan, path }),
            Err(error) => Err(wrong(&path, error)),
        }
    }

    #[getter]
    fn runs(&self) -> usize {
        self.plan.runs()
    }

    /// Plays the only run. Returns the program's summary as JSON.
    fn play(&self, py: Python<'_>) -> PyResult<String> {
        let played = interrupt::run(py, |stop| self.plan.play(stop))?;
        let outcome = played.map_err(|error| self.wrong(error))?;
        serde_json::to_string(&outcome).map_err(|error| self.wrong(error))
    }

    /// Plays some runs, on this many threads or on all processors. Returns the cells of each.
    #[pyo3(signature = (first, end, threads))]
    fn rows<'py>(
        &self,
        py: Python<'py>,
        first: usize,
        end: usize,
        threads: Option<usize>,
    ) -> PyResult<Vec<Bound<'py, PyList>>> {
        let runs = first..end.min(self.plan.runs());
        // More than these wait for each other.
        let cores = thread::available_parallelism().map_or(1, NonZero::get);
        let most = runs.len().clamp(1, THREADS_PER_CORE * cores);
        let threads = threads.unwrap_or(cores).clamp(1, most);
        let pool = ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().map_err(|error| self.wrong(error))?;
        let play = |stop: &AtomicBool| pool.install(|| self.plan.rows(runs, stop));
        let rows = interrupt::run(py, play)?.map_err(|error| self.wrong(error))?;
        rows.iter().map(|row| cells(py, row)).collect()
    }
}

/// Writes rows to a file, as the program does.
#[pyfunction]
pub(crate) fn write_table(
    path: PathBuf,
    rows: Vec<Vec<(String, Bound<'_, PyAny>)>>,
) -> PyResult<()> {
    let rows = rows.into_iter().map(row);
    let rows = rows.collect::<PyResult<Vec<Row>>>()?;
    let wrong = |error: siskin_emulator::record::RecordError| Error::new_err(error.to_string());
    let table = Table::create(&path).map_err(wrong)?;
    table.finish(&rows).map_err(wrong)
}
