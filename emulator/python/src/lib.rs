//! Compiled core of the Python package `siskin`: the emulator's laboratory and scenarios, called from Python.
//!
//! The package's Python files give it the interface that users see. Long calls let Python's other threads run, and end
//! on Ctrl-C.
#![forbid(unsafe_code)]

mod convert;
mod held;
mod interrupt;
mod laboratory;
mod plan;
mod state;

use pyo3::exceptions::PyValueError;

pyo3::create_exception!(
    siskin,
    Error,
    PyValueError,
    "Something cannot be done; the message is the line that the program prints."
);

/// The compiled part of siskin.
#[pyo3::pymodule]
mod _siskin {
    use pyo3::prelude::*;
    use siskin_emulator::bench::library;
    use siskin_emulator::record::Row;
    use siskin_params::ParamId;

    #[pymodule_export]
    use crate::Error;
    #[pymodule_export]
    use crate::laboratory::Laboratory;
    #[pymodule_export]
    use crate::plan::{Plan, write_table};
    #[pymodule_export]
    use crate::state::{EscState, Reply, Reported};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("BENCHES", library::names().collect::<Vec<_>>())?;
        let parameters = ParamId::ALL.iter().map(|id| id.entry().name);
        module.add("PARAMETERS", parameters.collect::<Vec<_>>())?;
        module.add("PHASES", crate::state::PHASES.to_vec())?;
        module.add("COLUMNS", Row::COLUMNS.to_vec())
    }
}
