//! A third quantity as colours, and the scale that explains them.

use plotters::backend::DrawingBackend;
use plotters::element::{PathElement, Rectangle};
use plotters::style::colors::colormaps::{ColorMap, ViridisRGB};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontTransform, RGBColor};

use super::scale::Scale;
use super::{Axis, Map};
use crate::plot::canvas::{Area, Drawn};
use crate::plot::style::{AXIS, text};

/// Number of colours of the scale. Steps read like contours, and neighbours of one colour are one
/// shape.
const STEPS: usize = 24;
/// Right of the axes: the space, the bar, its numbers and its name.
pub(super) const WIDTH: u32 = 240;
const SPACE: i32 = 24;
const BAR: i32 = 34;
/// Right of its name, so that it does not touch what stands beside the panel.
const AFTER: i32 = 40;
/// Least distance between the numbers.
const NUMBER: f64 = 48.0;

impl Map {
    /// Returns the edges of the cells: half way between the places, and as far beyond the outer
    /// ones.
    pub(super) fn edges(places: &[f64], scale: &Scale) -> Vec<f64> {
        let places: Vec<_> = places.iter().filter_map(|at| scale.place(*at)).collect();
        let (Some(first), Some(last)) = (places.first(), places.last()) else {
            return Vec::new();
        };
        let mut edges: Vec<_> = places
            .windows(2)
            .map(|pair| (pair[0] + pair[1]) / 2.0)
            .collect();
        let low = edges.first().map_or(first - 0.5, |edge| 2.0 * first - edge);
        let high = edges.last().map_or(last + 0.5, |edge| 2.0 * last - edge);
        edges.insert(0, low);
        edges.push(high);
        edges
    }

    /// Returns the values that the colours span.
    pub(super) fn scale(&self) -> Scale {
        let values = self.rows.iter().flatten().copied();
        let axis = Axis {
            range: self.range,
            ..Axis::new(&*self.label)
        };
        Scale::new(&axis, values, 0.0)
    }

    /// Draws the colours on the area within the axes.
    pub(super) fn draw<B: DrawingBackend>(
        &self,
        area: &Area<B>,
        (x, y): (&Scale, &Scale),
    ) -> Drawn<B> {
        let (width, height) = area.dim_in_pixel();
        let pixel = |edges: Vec<f64>, scale: &Scale, length: u32| -> Vec<i32> {
            let shares = edges.into_iter().map(|edge| scale.share(edge));
            let pixels = shares.map(|share| (share.clamp(0.0, 1.0) * f64::from(length)) as i32);
            pixels.collect()
        };
        let columns = pixel(Self::edges(&self.x, x), x, width);
        let lines = pixel(Self::edges(&self.y, y), y, height);
        let values = self.scale();
        for (row, line) in self.rows.iter().zip(lines.windows(2)) {
            let bottom = height as i32 - line[0];
            let top = height as i32 - line[1];
            let mut column = 0;
            let steps: Vec<_> = row.iter().map(|value| step(*value, &values)).collect();
            for run in steps.chunk_by(|a, b| a == b) {
                let first = column;
                column += run.len();
                let ends = (columns.get(first), columns.get(column));
                if let (Some(step), (Some(&left), Some(&right))) = (run[0], ends) {
                    let corners = [(left, top), (right, bottom)];
                    area.draw(&Rectangle::new(corners, colour(step).filled()))?;
                }
            }
        }
        Ok(())
    }

    /// Draws the colour scale to the right of the axes, which end at `left` and reach from `top` to
    /// `bottom`.
    pub(super) fn key<B: DrawingBackend>(
        &self,
        area: &Area<B>,
        left: i32,
        (top, bottom): (i32, i32),
    ) -> Drawn<B> {
        let (left, right) = (left + SPACE, left + SPACE + BAR);
        let height = f64::from(bottom - top);
        let at = |share: f64| bottom - (share * height) as i32;
        for step in 0..STEPS {
            let share = |step: usize| at(step as f64 / STEPS as f64);
            let corners = [(left, share(step + 1)), (right, share(step))];
            area.draw(&Rectangle::new(corners, colour(step).filled()))?;
        }
        area.draw(&Rectangle::new(
            [(left, top), (right, bottom)],
            AXIS.stroke_width(2),
        ))?;
        let scale = self.scale();
        let ticks = scale.ticks(|numbers| apart(numbers, &scale, height));
        for (place, number) in &ticks.numbers {
            let middle = at(scale.share(*place));
            let tick = vec![(right, middle), (right + 8, middle)];
            area.draw(&PathElement::new(tick, AXIS.stroke_width(2)))?;
            area.draw_text(number, &text(26.0), (right + 14, middle))?;
        }
        let (width, _) = area.dim_in_pixel();
        let name = text(28.0)
            .transform(FontTransform::Rotate270)
            .pos(Pos::new(HPos::Center, VPos::Bottom));
        area.draw_text(
            &self.label,
            &name,
            (width as i32 - AFTER, (top + bottom) / 2),
        )
    }
}

/// Returns true if stacked numbers on an axis of this height do not touch.
pub(super) fn apart(numbers: &[(f64, String)], scale: &Scale, height: f64) -> bool {
    let shares = |pair: &[(f64, String)]| scale.share(pair[1].0) - scale.share(pair[0].0);
    numbers
        .windows(2)
        .all(|pair| shares(pair) * height >= NUMBER)
}

/// Returns the index of a value's colour.
fn step(value: f64, scale: &Scale) -> Option<usize> {
    let share = scale.share(scale.place(value)?);
    Some(((share * STEPS as f64) as usize).min(STEPS - 1))
}

/// Returns a colour of Viridis, which works for the colour-blind and in grey.
fn colour(step: usize) -> RGBColor {
    ViridisRGB.get_color((step as f64 + 0.5) / STEPS as f64)
}
