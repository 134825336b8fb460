//! A run as a row of named cells.

use serde_json::Value;

use crate::scenario::judge::Verdict;
use crate::scenario::place::Place;
use crate::summary::Report;

/// The last columns: whether all expectations held, and why a run was refused, if one was.
const HELD: &str = "held";
const ERROR: &str = "error";

/// A value in a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// There is none.
    Nothing,
    /// True or false.
    Flag(bool),
    /// A whole number.
    Whole(u64),
    /// A number.
    Number(f64),
    /// Text.
    Text(String),
}

/// A run: its seed, the keys that were swept, set or drawn, its figures, and the results of its expectations.
#[derive(Clone, Debug, PartialEq)]
pub struct Row(pub(super) Vec<(String, Cell)>);

impl Row {
    /// Creates the row of a run that was refused: it did not hold, for this reason.
    pub fn refused(place: &Place, error: &str) -> Self {
        let mut cells = Self::placed(place);
        cells.extend([
            (HELD.to_owned(), Cell::Flag(false)),
            (ERROR.to_owned(), Cell::Text(error.to_owned())),
        ]);
        Self(cells)
    }

    fn placed(place: &Place) -> Vec<(String, Cell)> {
        let keys = place.set.iter().chain(&place.drawn);
        let keys = keys.map(|(key, value)| (key.clone(), Cell::of_key(value)));
        let seed = ("seed".to_owned(), Cell::Whole(place.seed));
        [seed].into_iter().chain(keys).collect()
    }

    /// Creates the row of a run.
    pub fn of(place: &Place, report: &Report, verdicts: &[Verdict]) -> Self {
        let mut cells = Self::placed(place);
        let faults = report.faults.iter().flatten().copied();
        let faults: Vec<_> = faults.collect();
        cells.extend([
            ("sim_s".to_owned(), Cell::Number(report.sim_s)),
            ("steps".to_owned(), Cell::Whole(report.steps)),
            (
                "trace_hash".to_owned(),
                Cell::Text(report.trace_hash.clone()),
            ),
            ("faults".to_owned(), Cell::Text(faults.join(", "))),
        ]);
        for window in &report.windows {
            // A window's figures are numbers and flags, so this cannot fail.
            let figures = serde_json::to_value(window).unwrap_or_default();
            let figures = figures.as_object().into_iter().flatten();
            let figures = figures.filter(|(key, _)| *key != "name");
            let name = &window.name;
            cells.extend(
                figures.map(|(key, value)| (format!("{name}.{key}"), Cell::of_figure(value))),
            );
        }
        for verdict in verdicts {
            let Verdict {
                window,
                key,
                wanted,
                held,
                ..
            } = verdict;
            let held = held.map_or(Cell::Nothing, Cell::Flag);
            cells.push((format!("{window}.{key} {wanted}"), held));
        }
        let held = !verdicts.iter().any(Verdict::failed);
        cells.push((HELD.to_owned(), Cell::Flag(held)));
        Self(cells)
    }

    /// Creates a row from cells received from elsewhere, such as another process.
    pub fn of_cells(cells: Vec<(String, Cell)>) -> Self {
        Self(cells)
    }

    /// Returns its cells with the names of their columns.
    pub fn cells(&self) -> &[(String, Cell)] {
        &self.0
    }

    pub(in crate::scenario) fn cell(&self, column: &str) -> &Cell {
        let cell = self.0.iter().find(|(name, _)| name == column);
        cell.map_or(&Cell::Nothing, |(_, cell)| cell)
    }
}

impl Cell {
    fn of_key(value: &toml::Value) -> Self {
        match value {
            toml::Value::Boolean(flag) => Self::Flag(*flag),
            toml::Value::Integer(number) => Self::Number(*number as f64),
            toml::Value::Float(number) => Self::Number(*number),
            toml::Value::String(text) => Self::Text(text.clone()),
            other => Self::Text(other.to_string()),
        }
    }

    fn of_figure(value: &Value) -> Self {
        match value {
            Value::Bool(flag) => Self::Flag(*flag),
            Value::Number(number) => number.as_f64().map_or(Self::Nothing, Self::Number),
            _ => Self::Nothing,
        }
    }
}

/// Returns the names of all cells, in order of appearance, whatever a refused run lacks: the verdicts come last.
pub(super) fn columns(rows: &[Row]) -> Vec<String> {
    let mut columns: Vec<String> = Vec::new();
    for (name, _) in rows.iter().flat_map(|row| &row.0) {
        if !columns.contains(name) {
            columns.push(name.clone());
        }
    }
    columns.sort_by_key(|name| match name.as_str() {
        HELD => 1,
        ERROR => 2,
        _ => 0,
    });
    columns
}
