//! One set of axes of a sheet.

use plotters::backend::DrawingBackend;
use plotters::chart::ChartBuilder;
use plotters::element::{Circle, PathElement, Rectangle};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBAColor, RGBColor, TextStyle};

use super::curve::{DASH, DOT, colours};
use super::map::{self, apart};
use super::scale::{Laid, Scale};
use super::{Curve, CurveLook, Map, Panel, Stretch};
use crate::plot::canvas::{Area, Drawn};
use crate::plot::style::{AXIS, FAULT, GRID, heading, length, text};

/// Left of the axes' name.
const EDGE: u32 = 16;
/// The name and the numbers at the left of the axes.
const LEFT: u32 = 164;
/// The numbers and the name below the axes.
const BELOW: u32 = 92;
/// Right of axes without a map: half a number of the x axis.
const RIGHT: u32 = 60;
/// Below the name of the x axis.
const FOOT: u32 = 20;
/// Least distance between the numbers of the x axis.
const NUMBER: f64 = 28.0;
/// Share of the y axis, and of the x axis, left free by the curves at either end.
const FREE: (f64, f64) = (0.05, 0.02);

/// Height of a line of the panel's title, and of the legend.
const TITLE: u32 = 44;
const ENTRIES: u32 = 40;
/// Height of the stretches' names.
const STRIP: u32 = 44;
/// The curve sample in the legend, the space before its name, and the one after it.
const SAMPLE: i32 = 54;
const NAME: i32 = 14;
const AFTER: i32 = 44;

/// What is above the axes.
pub(super) struct Header<'a> {
    title: Vec<String>,
    /// Lines of curves with their colours and left ends.
    legend: Vec<Vec<(&'a Curve, RGBColor, i32)>>,
    /// Height of the stretches' names.
    strip: u32,
}

impl Header<'_> {
    pub(super) fn height(&self) -> u32 {
        TITLE * self.title.len() as u32 + ENTRIES * self.legend.len() as u32 + 16 + self.strip
    }
}

impl Panel {
    /// Lays out what is above the axes of a panel of this width.
    pub(super) fn header(&self, width: u32) -> Header<'_> {
        let left = (EDGE + LEFT) as i32;
        let room = width as i32 - left - RIGHT as i32;
        let mut legend: Vec<Vec<_>> = Vec::new();
        let mut from = 0;
        let curves = self.curves.iter().zip(colours(&self.curves));
        for (curve, colour) in curves.filter(|(curve, _)| !curve.name.is_empty()) {
            let entry = SAMPLE + NAME + length(&curve.name, &text(26.0));
            match legend.last_mut() {
                Some(line) if from + entry <= room => line.push((curve, colour, left + from)),
                _ => {
                    from = 0;
                    legend.push(vec![(curve, colour, left)]);
                }
            }
            from += entry + AFTER;
        }
        Header {
            title: wrap(&self.title, &heading(30.0), room),
            legend,
            strip: if self.stretches.iter().any(|s| !s.name.is_empty()) {
                STRIP
            } else {
                0
            },
        }
    }

    /// Draws the panel, whose axes begin below the tallest header of its row.
    pub(super) fn draw<B: DrawingBackend>(
        &self,
        area: &Area<B>,
        header: &Header<'_>,
        top: u32,
    ) -> Drawn<B> {
        draw_header(area, header)?;
        let (width, height) = area.dim_in_pixel();
        let right = if self.map.is_some() {
            map::WIDTH
        } else {
            RIGHT
        };
        let (x, y) = (self.x_scale(), self.y_scale());
        let bottom = if self.x.label.is_empty() { 0 } else { BELOW };
        let (axes_width, axes_height) = (
            f64::from(width.saturating_sub(EDGE + LEFT + right)),
            f64::from(height.saturating_sub(top + bottom + FOOT)),
        );
        let beside = |numbers: &[(f64, String)]| {
            numbers.windows(2).all(|pair| {
                let between = (x.share(pair[1].0) - x.share(pair[0].0)) * axes_width;
                let length = |number: &str| f64::from(length(number, &text(26.0)));
                between >= (length(&pair[0].1) + length(&pair[1].1)) / 2.0 + NUMBER
            })
        };
        let below = |numbers: &[(f64, String)]| apart(numbers, &y, axes_height);
        let axes = (
            Laid {
                scale: &x,
                ticks: x.ticks(beside),
            },
            Laid {
                scale: &y,
                ticks: y.ticks(below),
            },
        );
        let mut chart = ChartBuilder::on(area)
            .margin_top(top)
            .margin_left(EDGE)
            .margin_right(right)
            .margin_bottom(FOOT)
            .y_label_area_size(LEFT)
            .x_label_area_size(bottom)
            .build_cartesian_2d(axes.0, axes.1)?;
        let within = chart.plotting_area().strip_coord_spec();
        let (x_pixels, y_pixels) = within.get_pixel_range();
        let (panel_x, panel_y) = area.get_pixel_range();
        let left = x_pixels.start - panel_x.start;
        // A value that the axis cannot place goes to its start.
        let along = |at| (x.share(x.place(at).unwrap_or(x.low)) * axes_width) as i32;
        for stretch in &self.stretches {
            let ends = (along(stretch.ends.0), along(stretch.ends.1));
            let corners = [(ends.0, 0), (ends.1, axes_height as i32)];
            within.draw(&Rectangle::new(corners, stretch.tint.filled()))?;
            if header.strip > 0 {
                stretch.label(area, (left + ends.0, left + ends.1), top)?;
            }
        }
        chart
            .configure_mesh()
            .light_line_style(GRID.mix(0.5).stroke_width(1))
            .bold_line_style(GRID.stroke_width(2))
            .axis_style(AXIS.stroke_width(2))
            .label_style(text(26.0))
            .axis_desc_style(text(28.0))
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .draw()?;
        if let Some(map) = &self.map {
            map.draw(&within, (&x, &y))?;
            let ends = (y_pixels.start - panel_y.start, y_pixels.end - panel_y.start);
            map.key(area, x_pixels.end - panel_x.start, ends)?;
        }
        for (curve, colour) in self.curves.iter().zip(colours(&self.curves)) {
            curve.draw(&within, (&x, &y), colour, self.map.is_some())?;
        }
        for fault in &self.faults {
            let at = along(*fault);
            let line = vec![(at, 0), (at, axes_height as i32)];
            within.draw(&PathElement::new(line, FAULT.stroke_width(3)))?;
        }
        Ok(())
    }

    fn x_scale(&self) -> Scale {
        let points = self.curves.iter().flat_map(|curve| &curve.points);
        let values = points
            .filter(|point| point.1.is_finite())
            .map(|point| point.0);
        match &self.map {
            None => Scale::new(&self.x, values, FREE.1),
            Some(map) => map_scale(&self.x, &map.x),
        }
    }

    fn y_scale(&self) -> Scale {
        let points = self.curves.iter().flat_map(|curve| &curve.points);
        let values = points
            .filter(|point| point.0.is_finite())
            .map(|point| point.1);
        match &self.map {
            None => Scale::new(&self.y, values, FREE.0),
            Some(map) => map_scale(&self.y, &map.y),
        }
    }
}

impl Stretch {
    /// Draws its name above the axes, if it fits between its ends.
    fn label<B: DrawingBackend>(&self, area: &Area<B>, ends: (i32, i32), top: u32) -> Drawn<B> {
        let (top, bottom) = ((top - STRIP) as i32, top as i32);
        let corners = [(ends.0, top), (ends.1, bottom)];
        area.draw(&Rectangle::new(corners, self.tint.filled()))?;
        area.draw(&Rectangle::new(corners, GRID.stroke_width(2)))?;
        let style = text(26.0);
        if ends.1 - ends.0 < length(self.name, &style) + 12 {
            return Ok(());
        }
        let style = style.pos(Pos::new(HPos::Center, VPos::Center));
        area.draw_text(
            self.name,
            &style,
            ((ends.0 + ends.1) / 2, (top + bottom) / 2),
        )
    }
}

/// Returns the axis of a map: all of its cells.
fn map_scale(axis: &super::Axis, places: &[f64]) -> Scale {
    let mut scale = Scale::new(axis, places.iter().copied(), 0.0);
    let edges = Map::edges(places, &scale);
    if let (None, Some(&low), Some(&high)) = (axis.range, edges.first(), edges.last()) {
        (scale.low, scale.high) = (low, high);
    }
    scale
}

fn draw_header<B: DrawingBackend>(area: &Area<B>, header: &Header<'_>) -> Drawn<B> {
    let mut middle = TITLE as i32 / 2;
    for line in &header.title {
        area.draw_text(line, &heading(30.0), ((EDGE + LEFT) as i32, middle))?;
        middle += TITLE as i32;
    }
    for line in &header.legend {
        for &(curve, colour, left) in line {
            sample(area, curve, colour, (left, middle))?;
            area.draw_text(&curve.name, &text(26.0), (left + SAMPLE + NAME, middle))?;
        }
        middle += ENTRIES as i32;
    }
    Ok(())
}

/// Draws a sample of a curve beside its name.
fn sample<B: DrawingBackend>(
    area: &Area<B>,
    curve: &Curve,
    colour: RGBColor,
    (left, middle): (i32, i32),
) -> Drawn<B> {
    let dash = |from: i32, to: i32, thickness: i32, colour: RGBAColor| {
        let (above, below) = (thickness / 2, (thickness + 1) / 2);
        let corners = [(left + from, middle - above), (left + to, middle + below)];
        area.draw(&Rectangle::new(corners, colour.filled()))
    };
    let (line, full) = (curve.width as i32, colour.mix(1.0));
    match curve.look {
        CurveLook::Line => {
            if !curve.spread.is_empty() {
                dash(0, SAMPLE, 18, colour.mix(0.3))?;
            }
            dash(0, SAMPLE, line, full)
        }
        CurveLook::Dashed => {
            dash(0, DASH.0, line, full)?;
            dash(DASH.0 + DASH.1, SAMPLE, line, full)
        }
        CurveLook::Band => dash(0, SAMPLE, 18, colour.mix(0.35)),
        CurveLook::Dots => area.draw(&Circle::new(
            (left + SAMPLE / 2, middle),
            DOT,
            colour.filled(),
        )),
    }
}

/// Breaks a text into lines of at most `room` pixels.
pub(super) fn wrap(text: &str, style: &TextStyle<'_>, room: i32) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if length(&format!("{line} {word}"), style) <= room => {
                *line = format!("{line} {word}");
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}
