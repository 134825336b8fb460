//! The figure of a recording: four panels over a common time axis.

use plotters::style::{RGBColor, WHITE};
use siskin_control::drive::Fault;
use siskin_scope::printable;

use super::chart::{Axis, Curve, CurveLook, Figure, Panel, Stretch};
use super::phases::{fault_times, name, spans, tint};
use super::read::Recording;
use super::reduce::{Cell, Trace};
use super::style::{BLUE, GREEN, GREY, ORANGE, VERMILION, number};

/// Columns that a recording is reduced to: one per some two and a half pixels, so that the SVG of a long recording
/// stays below 300 kB.
pub(super) const COLUMNS: usize = 900;

/// Size of a panel.
const PANEL: (u32, u32) = (2400, 530);

/// How far within the end of an axis the mark of what is beyond it stands, as a share of the axis.
const RIM: f64 = 0.02;

/// Quantities of a recording on a panel: the least height of its axes, in the unit, since less is noise that would fill
/// the panel, and the share of the columns at either end that may exceed them.
struct Shown<'a> {
    title: &'a str,
    axis: &'a str,
    curves: Vec<(Curve, &'a Trace)>,
    least_span: f64,
    outliers: f64,
}

/// Draws speeds, currents, voltages and the angle error.
pub(super) fn figure(recording: &Recording) -> Figure {
    let r = recording;
    let line = |name, trace, colour, width| (means(r, name, trace, colour, width), trace);
    let spread = |name, trace, colour| {
        let line = means(r, name, trace, colour, 3);
        let spread = spread(trace);
        (Curve { spread, ..line }, trace)
    };
    let band = |name, trace, colour| {
        let (curve, _) = spread(name, trace, colour);
        let look = CurveLook::Band;
        (Curve { look, ..curve }, trace)
    };
    let shown = [
        Shown {
            title: "Speed",
            axis: "speed (rpm)",
            curves: vec![
                line("reference", &r.rpm_ref, GREY, 7),
                line("true", &r.rpm, BLUE, 5),
                line("estimated", &r.rpm_est, ORANGE, 3),
            ],
            least_span: 10.0,
            outliers: 0.0,
        },
        Shown {
            title: "Currents",
            axis: "current (A)",
            curves: vec![
                band("phase a", &r.i_a_a, GREY),
                spread("i_d", &r.i_d_a, BLUE),
                spread("i_q", &r.i_q_a, VERMILION),
            ],
            least_span: 0.5,
            outliers: 0.0,
        },
        Shown {
            title: "Voltages",
            axis: "voltage (V)",
            curves: vec![
                line("bus/√3", &r.u_max_v, GREY, 4),
                spread("u_d", &r.u_d_v, BLUE),
                spread("u_q", &r.u_q_v, VERMILION),
            ],
            least_span: 0.5,
            outliers: 0.0,
        },
        Shown {
            title: "Angle error: estimated less true, while the observer leads",
            axis: "error (el. °)",
            curves: vec![spread("angle error", &r.angle_error_deg, GREEN)],
            least_span: 1.0,
            // The observer's first periods may be far off, and would flatten the rest.
            outliers: 0.005,
        },
    ];
    let last = shown.len() - 1;
    let panels = shown.into_iter().enumerate();
    Figure {
        name: String::new(),
        title: title(recording),
        columns: 1,
        panel: PANEL,
        panels: panels
            .map(|(index, shown)| shown.panel(recording, index == 0, index == last))
            .collect(),
    }
}

impl Shown<'_> {
    fn panel(self, recording: &Recording, first: bool, last: bool) -> Panel {
        let time = Axis {
            range: Some((recording.t0_s, recording.t1_s)),
            ..Axis::new(if last { "time (s)" } else { "" })
        };
        let values = Axis {
            range: Some(self.range()),
            ..Axis::new(self.axis)
        };
        let meaning = self
            .curves
            .iter()
            .any(|(curve, _)| !curve.spread.is_empty());
        let more = [self.beyond(recording), meaning.then(meaning_of_bands)];
        let curves = self.curves.into_iter().map(|(curve, _)| curve);
        let curves = curves.chain(more.into_iter().flatten()).collect();
        let stretches = spans(recording).into_iter().map(|span| Stretch {
            name: if first { name(span.phase) } else { "" },
            ends: (span.t0_s, span.t1_s),
            tint: tint(span.phase).unwrap_or(WHITE),
        });
        Panel {
            stretches: stretches.collect(),
            faults: fault_times(recording),
            ..Panel::new(self.title, time, values, curves)
        }
    }

    /// Returns marks at the end of the value axis for the columns that reach beyond it, if there are any.
    fn beyond(&self, recording: &Recording) -> Option<Curve> {
        let (low, high) = self.range();
        let rim = RIM * (high - low);
        let mut furthest = 0.0_f64;
        let mut points = Vec::new();
        for (_, trace) in self.curves.iter().filter(|_| self.outliers > 0.0) {
            for (column, cell) in trace.cells().iter().enumerate() {
                let Some(cell) = cell else { continue };
                for (value, is_beyond, end) in [
                    (cell.min, cell.min < low, low + rim),
                    (cell.max, cell.max > high, high - rim),
                ] {
                    if is_beyond {
                        points.push((recording.time_s(column), end));
                        if value.abs() > furthest.abs() {
                            furthest = value;
                        }
                    }
                }
            }
        }
        let name = format!("beyond the axis, to {}", number(furthest.round()));
        let dots = (!points.is_empty()).then(|| Curve::dots(name, points));
        dots.map(|dots| Curve {
            colour: Some(VERMILION),
            ..dots
        })
    }

    /// Returns the range of the value axis: all curves, with some room.
    fn range(&self) -> (f64, f64) {
        let ranges = self.curves.iter().filter_map(|(curve, trace)| {
            if curve.spread.is_empty() {
                trace.range(self.outliers, Cell::mean, Cell::mean)
            } else {
                trace.range(self.outliers, |cell| cell.min, |cell| cell.max)
            }
        });
        let (low, high) = ranges
            .reduce(|all, one| (all.0.min(one.0), all.1.max(one.1)))
            .unwrap_or((0.0, 0.0));
        let span = (high - low).max(self.least_span);
        let middle = (low + high) / 2.0;
        (middle - 0.55 * span, middle + 0.55 * span)
    }
}

/// Returns an entry of the legend alone.
fn meaning_of_bands() -> Curve {
    Curve {
        look: CurveLook::Band,
        colour: Some(GREY),
        ..Curve::line("band: least to greatest, line: mean", [])
    }
}

/// Returns a line through the means of a trace.
fn means(recording: &Recording, name: &str, trace: &Trace, colour: RGBColor, width: u32) -> Curve {
    let cells = trace.cells().iter().enumerate();
    let points = cells.map(|(column, cell)| {
        let mean = cell.as_ref().map_or(f64::NAN, Cell::mean);
        (recording.time_s(column), mean)
    });
    Curve {
        colour: Some(colour),
        width,
        ..Curve::line(name, points)
    }
}

/// Returns the ranges of a trace's columns.
fn spread(trace: &Trace) -> Vec<(f64, f64)> {
    let nothing = (f64::NAN, f64::NAN);
    let cells = trace.cells().iter();
    cells
        .map(|cell| cell.map_or(nothing, |cell| (cell.min, cell.max)))
        .collect()
}

/// Describes what was recorded, and its faults.
fn title(recording: &Recording) -> String {
    let length_s = recording.t1_s - recording.t0_s;
    let rate_khz = recording.periods as f64 / length_s / 1e3;
    let title = format!(
        "{}: {} s at {rate_khz:.1} kHz",
        printable::line(&recording.name),
        number(length_s)
    );
    let bits = recording.faults.iter().fold(0, |all, bits| all | bits);
    let faults = Fault::ALL.iter();
    let faults = faults.filter(|fault| bits & 1 << **fault as u8 != 0);
    let faults: Vec<_> = faults.map(|fault| fault.text()).collect();
    match faults.as_slice() {
        [] => title,
        faults => format!("{title}; fault: {}", faults.join(", ")),
    }
}
