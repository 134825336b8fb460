//! A curve on its axes, with no more points than the pixels can show.

use plotters::backend::DrawingBackend;
use plotters::element::{Circle, DashedPathElement, PathElement, Polygon};
use plotters::style::{Color, RGBColor, ShapeStyle, WHITE};

use super::scale::Scale;
use super::{Curve, CurveLook};
use crate::plot::canvas::{Area, Drawn};
use crate::plot::style::{BLUE, GREEN, INK, ORANGE, PURPLE, SKY, VERMILION};

/// Length of a dash, and of the gap after it.
pub(super) const DASH: (i32, i32) = (20, 14);
/// Radius of a dot.
pub(super) const DOT: i32 = 7;
/// Width of the white rim that sets a curve off from a map.
const RIM: u32 = 3;
/// Columns to which a dense line is reduced are this wide.
const COLUMN: f64 = 3.0;
/// Points per column above which a line is dense.
const DENSE: usize = 4;
/// Most dots that one curve shows where they are close together.
const DOTS: usize = 1200;

const COLOURS: [RGBColor; 7] = [BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, INK];

type Point = (f64, f64);

/// Assigns the colours of a panel's curves. If there is one dashed curve, or one of dots, per line,
/// they pair up in the lines' order, and the second is a darker shade of the first.
pub(super) fn colours(curves: &[Curve]) -> Vec<RGBColor> {
    let count = |look| curves.iter().filter(|curve| curve.look == look).count();
    let mut free = COLOURS.iter().cycle();
    let mut lines = Vec::new();
    let mut taken = [0; 2];
    let own = curves.iter().map(|curve| {
        if curve.colour.is_some() {
            return (curve.look, curve.colour);
        }
        let pairs = count(curve.look) == count(CurveLook::Line);
        if curve.look == CurveLook::Line || !pairs {
            let colour = free.next().copied().unwrap_or(INK);
            lines.extend((curve.look == CurveLook::Line).then_some(colour));
            return (curve.look, Some(colour));
        }
        (curve.look, None)
    });
    let own: Vec<_> = own.collect();
    let colours = own.into_iter().map(|(look, own)| {
        own.unwrap_or_else(|| {
            let nth = &mut taken[usize::from(look == CurveLook::Dots)];
            *nth += 1;
            lines.get(*nth - 1).map_or(INK, |line| darker(*line))
        })
    });
    colours.collect()
}

fn darker(colour: RGBColor) -> RGBColor {
    let half = |channel: u8| (f64::from(channel) * 0.55) as u8;
    RGBColor(half(colour.0), half(colour.1), half(colour.2))
}

impl Curve {
    /// Draws the curve on the area within the axes.
    pub(super) fn draw<B: DrawingBackend>(
        &self,
        area: &Area<B>,
        (x, y): (&Scale, &Scale),
        colour: RGBColor,
        on_map: bool,
    ) -> Drawn<B> {
        let (width, height) = area.dim_in_pixel();
        let size = (f64::from(width - 1), f64::from(height - 1));
        let pixel = |&(at_x, at_y): &Point| {
            let (at_x, at_y) = (x.place(at_x)?, y.place(at_y)?);
            Some((x.share(at_x) * size.0, (1.0 - y.share(at_y)) * size.1))
        };
        let pixels: Vec<_> = self.points.iter().map(pixel).collect();
        if self.look == CurveLook::Dots {
            for centre in dots(pixels.iter().flatten().copied(), size) {
                if on_map {
                    area.draw(&Circle::new(centre, DOT + RIM as i32, WHITE.filled()))?;
                }
                area.draw(&Circle::new(centre, DOT, colour.filled()))?;
            }
            return Ok(());
        }
        let height = |value: f64| Some((1.0 - y.share(y.place(value)?)) * size.1);
        let pieces = pixels.iter().enumerate().map(|(index, pixel)| {
            let mean = (*pixel)?;
            let (high, low) = match self.spread.get(index) {
                Some(&(least, greatest)) => (height(least)?, height(greatest)?),
                None => (mean.1, mean.1),
            };
            Some(Column { mean, low, high })
        });
        let pieces: Vec<_> = pieces.collect();
        for run in pieces.split(Option::is_none) {
            let run: Vec<_> = run.iter().copied().flatten().collect();
            let dense = reduced(&run);
            let has_band = dense.is_some() && self.look == CurveLook::Line;
            let run = dense.unwrap_or(run);
            if has_band || !self.spread.is_empty() {
                let at = |y: fn(&Column) -> f64| run.iter().map(move |c| (c.mean.0, y(c)));
                let band = at(|column| column.low).chain(at(|column| column.high).rev());
                let band =
                    band.map(|(x, y)| (x.round() as i32, y.clamp(0.0, size.1).round() as i32));
                let band: Vec<_> = band.collect();
                if self.look == CurveLook::Band {
                    let edge = colour.mix(0.5).stroke_width(2);
                    area.draw(&PathElement::new(band.clone(), edge))?;
                }
                area.draw(&Polygon::new(band, colour.mix(0.3)))?;
            }
            if self.look == CurveLook::Band {
                continue;
            }
            let run: Vec<_> = run.iter().map(|column| column.mean).collect();
            for line in clip(&run, size) {
                if on_map {
                    path(area, &line, WHITE.stroke_width(self.width + 2 * RIM))?;
                }
                let style = colour.stroke_width(self.width);
                if self.look == CurveLook::Dashed {
                    area.draw(&DashedPathElement::new(line, DASH.0, DASH.1, style))?;
                } else if self.spread.is_empty() {
                    path(area, &line, style)?;
                } else {
                    // A noisy line in pieces would make a long recording's file half as large
                    // again.
                    area.draw(&PathElement::new(line, style))?;
                }
            }
        }
        Ok(())
    }
}

/// A piece of a line: its mean, and the range of heights about it.
#[derive(Clone, Copy)]
struct Column {
    mean: Point,
    low: f64,
    high: f64,
}

/// Reduces a dense line that runs to the right to columns of pixels.
fn reduced(line: &[Column]) -> Option<Vec<Column>> {
    let column = |piece: &Column| (piece.mean.0 / COLUMN).floor();
    let span = column(line.last()?) - column(line.first()?) + 1.0;
    let dense = line.len() as f64 > DENSE as f64 * span;
    if !dense || !line.is_sorted_by(|a, b| a.mean.0 <= b.mean.0) {
        return None;
    }
    let columns = line.chunk_by(|a, b| column(a) == column(b));
    let columns = columns.map(|within| {
        let mean =
            |value: fn(&Column) -> f64| within.iter().map(value).sum::<f64>() / within.len() as f64;
        let heights = |value: fn(&Column) -> f64| within.iter().map(value);
        Column {
            mean: (mean(|piece| piece.mean.0), mean(|piece| piece.mean.1)),
            low: heights(|piece| piece.low).fold(f64::INFINITY, f64::min),
            high: heights(|piece| piece.high).fold(f64::NEG_INFINITY, f64::max),
        }
    });
    Some(columns.collect())
}

/// Draws a line in pieces that end where it turns back by more than a right angle: there the
/// library's joints reach far beyond the line.
fn path<B: DrawingBackend>(area: &Area<B>, line: &[(i32, i32)], style: ShapeStyle) -> Drawn<B> {
    let back = |at: usize| {
        let (a, b, c) = (line[at - 1], line[at], line[at + 1]);
        (b.0 - a.0) * (c.0 - b.0) + (b.1 - a.1) * (c.1 - b.1) < 0
    };
    let mut from = 0;
    for turn in (1..line.len() - 1).filter(|at| back(*at)) {
        area.draw(&PathElement::new(&line[from..=turn], style))?;
        from = turn;
    }
    area.draw(&PathElement::new(&line[from..], style))
}

/// Returns the parts of a line within the area, on whole pixels, each of two points or more.
fn clip(points: &[Point], size: Point) -> Vec<Vec<(i32, i32)>> {
    let mut lines: Vec<Vec<(i32, i32)>> = Vec::new();
    let mut leaves = true;
    for ends in points.windows(2) {
        let (from, to) = (ends[0], ends[1]);
        let Some((enter, exit)) = inside(from, to, size) else {
            leaves = true;
            continue;
        };
        let at = |share: f64| {
            let along = |from: f64, to: f64| (from + share * (to - from)).round() as i32;
            (along(from.0, to.0), along(from.1, to.1))
        };
        if leaves || enter > 0.0 {
            lines.push(vec![at(enter)]);
        }
        if let Some(line) = lines.last_mut() {
            line.push(at(exit));
            line.dedup();
        }
        leaves = exit < 1.0;
    }
    lines.retain(|line| line.len() >= 2);
    lines
}

/// Returns where between two points the line enters and leaves the area, as shares of the way
/// (Liang-Barsky clipping).
fn inside(from: Point, to: Point, size: Point) -> Option<(f64, f64)> {
    let (mut enter, mut exit) = (0.0_f64, 1.0_f64);
    for (start, way, end) in [
        (from.0, to.0 - from.0, size.0),
        (from.1, to.1 - from.1, size.1),
    ] {
        if way == 0.0 {
            if !(0.0..=end).contains(&start) {
                return None;
            }
            continue;
        }
        let (a, b) = (-start / way, (end - start) / way);
        enter = enter.max(a.min(b));
        exit = exit.min(a.max(b));
    }
    (enter <= exit).then_some((enter, exit))
}

/// Returns the dots within the area; only one of those close together.
fn dots(points: impl Iterator<Item = Point>, size: Point) -> Vec<(i32, i32)> {
    let within =
        |point: &Point| (0.0..=size.0).contains(&point.0) && (0.0..=size.1).contains(&point.1);
    let mut dots: Vec<_> = points
        .filter(within)
        .map(|point| (point.0.round() as i32, point.1.round() as i32))
        .collect();
    let mut apart = 4;
    loop {
        let mut taken = std::collections::HashSet::new();
        dots.retain(|dot| taken.insert((dot.0 / apart, dot.1 / apart)));
        if dots.len() <= DOTS {
            return dots;
        }
        apart *= 2;
    }
}
