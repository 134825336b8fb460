//! Shorthands for pictures.

use crate::plot::chart::{Axis, Figure, PANEL, Panel};

/// Creates a sheet with its panels in `columns` columns.
pub(super) fn figure(name: &str, title: &str, columns: usize, panels: Vec<Panel>) -> Figure {
    Figure {
        name: name.to_owned(),
        title: title.to_owned(),
        columns,
        panel: PANEL,
        panels,
    }
}

/// Creates an axis with these ends.
pub(super) fn between(label: &str, from: f64, to: f64) -> Axis {
    Axis {
        range: Some((from, to)),
        ..Axis::new(label)
    }
}

/// Creates the same with equal lengths for equal ratios.
pub(super) fn ratios(label: &str, from: f64, to: f64) -> Axis {
    Axis {
        logarithmic: true,
        ..between(label, from, to)
    }
}

/// Returns `count` values from one to the other at equal ratios.
pub(super) fn spread(from: f64, to: f64, count: u32) -> impl Iterator<Item = f64> {
    let rise = libm::log(to / from) / f64::from(count - 1);
    (0..count).map(move |step| from * libm::exp(rise * f64::from(step)))
}

/// Returns `count` values from one to the other at equal distances.
pub(super) fn evenly(from: f64, to: f64, count: u32) -> impl Iterator<Item = f64> {
    let rise = (to - from) / f64::from(count - 1);
    (0..count).map(move |step| from + rise * f64::from(step))
}

/// Evaluates a formula over these places.
pub(super) fn over(
    places: impl Iterator<Item = f64>,
    formula: impl Fn(f64) -> f64,
) -> Vec<(f64, f64)> {
    places.map(|x| (x, formula(x))).collect()
}
