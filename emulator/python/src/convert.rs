//! Values of Python as those of a scenario's file and of a table, and back.

use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use siskin_emulator::scenario::{Cell, Row};
use toml::{Table, Value};

use crate::Error;

/// A value of a scenario's file.
pub(crate) fn to_toml(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    // A bool is an int in Python, and so comes first.
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
    // Numbers of numpy too.
    if let Ok(number) = value.extract::<f64>() {
        return Ok(Value::Float(number));
    }
    let kind = value.get_type().name()?;
    let what = format!("a {kind} is no value of a scenario; give a number, text, list or dict");
    Err(Error::new_err(what))
}

/// A table of a scenario's file.
pub(crate) fn to_table(table: &Bound<'_, PyDict>) -> PyResult<Table> {
    let entries = table.iter();
    let entries = entries.map(|(key, value)| Ok((key.extract()?, to_toml(&value)?)));
    entries.collect()
}

/// A run's cells as pairs of a name and None, a bool, an int, a float or a str.
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

/// The run that such cells are of.
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
