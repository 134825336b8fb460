//! One set of axes of the figure, with its legend above.

use plotters::backend::DrawingBackend;
use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::types::RangedCoordf64;
use plotters::element::{PathElement, Polygon, Rectangle};
use plotters::style::{Color, RGBAColor, RGBColor};

use super::canvas::{Area, Drawn};
use super::page::{LEFT, RIGHT, legend};
use super::phases::{fault_times, spans, tint};
use super::read::Recording;
use super::reduce::{Cell, Trace};
use super::style::{AXIS, FAULT, GRID, heading, number, text};

type Axes<'a, B> = ChartContext<'a, B, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Height of the title's and legend's line.
const HEADER: u32 = 52;

/// Left of the axes' names.
const EDGE: u32 = 24;

/// Height of the time's numbers and name below the lowest axes.
const TIME: u32 = 80;

/// How a quantity is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    /// A line of this width through the means.
    Line(u32),
    /// A band over what each column spans, and a line of this width through the means.
    Spread(u32),
    /// A band alone.
    Band,
}

/// A quantity on a panel.
pub(super) struct Curve<'a> {
    pub(super) name: &'a str,
    pub(super) trace: &'a Trace,
    pub(super) colour: RGBColor,
    pub(super) look: Look,
}

/// One set of axes.
pub(super) struct Panel<'a> {
    pub(super) title: &'a str,
    /// What the values are, with their unit.
    pub(super) axis: &'a str,
    /// Drawn in this order.
    pub(super) curves: &'a [Curve<'a>],
    /// Share of the columns at either end of the values that may reach beyond the axes.
    pub(super) outliers: f64,
    /// Least height of the axes, in the unit: less is noise that would fill the panel.
    pub(super) least_span: f64,
    /// Whether the time is written below.
    pub(super) time: bool,
}

impl Panel<'_> {
    /// Space around the axes, from top to bottom.
    pub(super) fn margins(time: bool) -> u32 {
        HEADER + if time { TIME } else { 0 }
    }

    pub(super) fn draw<B: DrawingBackend>(
        &self,
        area: &Area<B>,
        recording: &Recording,
    ) -> Drawn<B> {
        self.header(area)?;
        let (low, high) = self.range();
        let mut chart = ChartBuilder::on(area)
            .margin_top(HEADER)
            .margin_left(EDGE)
            .margin_right(RIGHT)
            .y_label_area_size(LEFT - EDGE)
            .x_label_area_size(if self.time { TIME } else { 0 })
            .build_cartesian_2d(recording.t0_s..recording.t1_s, low..high)?;

        for span in spans(recording) {
            if let Some(tint) = tint(span.phase) {
                let corners = [(span.t0_s, low), (span.t1_s, high)];
                chart.draw_series([Rectangle::new(corners, tint.filled())])?;
            }
        }
        let label = |value: &f64| number(*value);
        chart
            .configure_mesh()
            .x_labels(12)
            .y_labels(6)
            .max_light_lines(0)
            .bold_line_style(GRID.stroke_width(1))
            .axis_style(AXIS.stroke_width(2))
            .label_style(text(26.0))
            .axis_desc_style(text(28.0))
            .x_label_formatter(&label)
            .y_label_formatter(&label)
            .x_desc(if self.time { "time (s)" } else { "" })
            .y_desc(self.axis)
            .draw()?;
        for curve in self.curves {
            curve.draw(&mut chart, recording, low, high)?;
        }
        for t_s in fault_times(recording) {
            let line = PathElement::new(vec![(t_s, low), (t_s, high)], FAULT.stroke_width(3));
            chart.draw_series([line])?;
        }
        Ok(())
    }

    fn header<B: DrawingBackend>(&self, area: &Area<B>) -> Drawn<B> {
        let entries = self.curves.iter().map(|curve| {
            let thickness = match curve.look {
                Look::Line(width) | Look::Spread(width) => width as i32 + 2,
                Look::Band => 18,
            };
            (curve.name, curve.fill(), thickness)
        });
        let middle = HEADER as i32 / 2;
        legend(area, middle, entries)?;
        let title = heading(30.0);
        area.draw_text(self.title, &title, (LEFT as i32, middle))
    }

    /// What the axis of values spans: all curves, with some room.
    fn range(&self) -> (f64, f64) {
        let ranges = self.curves.iter().filter_map(|curve| match curve.look {
            Look::Line(_) => curve.trace.range(self.outliers, Cell::mean, Cell::mean),
            Look::Spread(_) | Look::Band => {
                curve
                    .trace
                    .range(self.outliers, |cell| cell.min, |cell| cell.max)
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

impl Curve<'_> {
    fn fill(&self) -> RGBAColor {
        match self.look {
            Look::Band => self.colour.mix(0.35),
            Look::Line(_) | Look::Spread(_) => self.colour.mix(1.0),
        }
    }

    fn draw<B: DrawingBackend>(
        &self,
        chart: &mut Axes<'_, B>,
        recording: &Recording,
        low: f64,
        high: f64,
    ) -> Drawn<B> {
        for (first, cells) in self.trace.stretches() {
            let along = |value: fn(&Cell) -> f64| {
                let points = cells.iter().enumerate();
                points.map(move |(k, cell)| {
                    (recording.time_s(first + k), value(cell).clamp(low, high))
                })
            };
            if self.look == Look::Band || matches!(self.look, Look::Spread(_)) {
                let there = along(|cell| cell.max);
                let outline: Vec<_> = there.chain(along(|cell| cell.min).rev()).collect();
                if self.look == Look::Band {
                    let edge = self.colour.mix(0.5).stroke_width(2);
                    chart.draw_series([PathElement::new(outline.clone(), edge)])?;
                }
                chart.draw_series([Polygon::new(outline, self.colour.mix(0.3))])?;
            }
            if let Look::Line(width) | Look::Spread(width) = self.look {
                let points: Vec<_> = along(Cell::mean).collect();
                chart.draw_series([PathElement::new(points, self.colour.stroke_width(width))])?;
            }
        }
        Ok(())
    }
}
