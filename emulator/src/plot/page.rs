//! What all lines of a recording's figure keep to: where the axes begin and end, and a legend.

use plotters::backend::DrawingBackend;
use plotters::element::Rectangle;
use plotters::style::{Color, RGBAColor};

use super::canvas::{Area, Drawn};
use super::style::text;

/// Width of the figure.
pub(super) const WIDTH: u32 = 2400;
/// Left of the axes.
pub(super) const LEFT: u32 = 150;
/// Right of the axes.
pub(super) const RIGHT: u32 = 40;

/// A line of legend that ends at the right of the axes: names, colours, thickness of the samples.
pub(super) fn legend<'a, B: DrawingBackend>(
    area: &Area<B>,
    middle: i32,
    entries: impl IntoIterator<Item = (&'a str, RGBAColor, i32), IntoIter: DoubleEndedIterator>,
) -> Drawn<B> {
    let style = text(26.0);
    let mut right = (WIDTH - RIGHT) as i32;
    for (name, colour, thickness) in entries.into_iter().rev() {
        let left = right - area.estimate_text_size(name, &style)?.0 as i32;
        area.draw_text(name, &style, (left, middle))?;
        let corners = [
            (left - 64, middle - thickness / 2),
            (left - 14, middle + (thickness + 1) / 2),
        ];
        area.draw(&Rectangle::new(corners, colour.filled()))?;
        right = left - 100;
    }
    Ok(())
}
