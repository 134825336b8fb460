//! Converts Python values to those of a scenario file and of a table, and back.

use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use siskin_emulator::scenario::{Cell, Row};
use toml::{Table, Value};

use crate::Error;

/// Converts a value to that of a scenario file.
pub(crate) fn to_toml(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    // A bool is also an int in Python, so it comes first.
    if let Ok(flag) = value.cast::<PyBool>() {
        return Ok(Value::Boolean(flag.is_true()));
    }
    if value.is_instance_of::<PyInt>() {
        return Ok(Value::Integer(value.extract()?));
    }
    if let Ok(table) = value.cast::<PyDict>() {
        return Ok(Value::Table(to_table(table)?));
    }
    if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        let entries = value.try_iter()?.map(|entry| to_toml(&entry?));
        return Ok(Value::Array(entries.collect::<PyResult<_>>()?));
    }
    if let Ok(text) = value.extract::<String>() {
        return Ok(Value::String(text));
    }
    // Includes numpy's numbers.
    if let Ok(number) = value.extract::<f64>() {
        return Ok(Value::Float(number));
    }
    let kind = value.get_type().name()?;
    let what = format!("a {kind} is not a scenario value; give a number, text, list or dict");
    Err(Error::new_err(what))
}

/// Converts a dict to a table of a scenario file.
pub(crate) fn to_table(table: &Bound<'_, PyDict>) -> PyResult<Table> {
    let entries = table.iter();
    let entries = entries.map(|(key, value)| Ok((key.extract()?, to_toml(&value)?)));
    entries.collect()
}

/// Converts a run's cells to pairs of a name and None, a bool, an int, a float or a str.
pub(crate) fn cells<'py>(py: Python<'py>, row: &Row) -> PyResult<Bound<'py, PyList>> {
    let cells = row.cells().iter().map(|(name, cell)| {
        let value = match cell {
            Cell::Nothing => py.None().into_bound(py),
            Cell::Flag(flag) => flag.into_bound_py_any(py)?,
            Cell::Whole(number) => number.into_bound_py_any(py)?,
            Cell::Number(number) => number.into_bound_py_any(py)?,
            Cell::Text(text) => text.into_bound_py_any(py)?,
        };
        (name, value).into_bound_py_any(py)
    });
    PyList::new(py, cells.collect::<PyResult<Vec<_>>>()?)
}

/// Converts such cells back to a run.
pub(crate) fn row(cells: Vec<(String, Bound<'_, PyAny>)>) -> PyResult<Row> {
    let cells = cells.into_iter().map(|(name, value)| {
        let cell = if value.is_none() {
            Cell::Nothing
        } else if let Ok(flag) = value.cast::<PyBool>() {
            Cell::Flag(flag.is_true())
        } else if value.is_instance_of::<PyInt>() {
            Cell::Whole(value.extract()?)
        } else if value.is_instance_of::<PyFloat>() {
            Cell::Number(value.extract()?)
        } else {
            Cell::Text(value.cast::<PyString>()?.to_string())
        };
        Ok((name, cell))
    });
    Ok(Row::of_cells(cells.collect::<PyResult<_>>()?))
}
