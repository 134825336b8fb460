//! What all pictures share: font, colours, number format.

use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, IntoFont, RGBColor, TextStyle};

/// The font's family.
pub(super) const FONT: &str = "sans-serif";

/// Text.
pub(super) const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
/// Frames of the axes.
pub(super) const AXIS: RGBColor = RGBColor(0x77, 0x77, 0x77);
/// Lines at the ticks.
pub(super) const GRID: RGBColor = RGBColor(0xc0, 0xc0, 0xc0);
/// References and envelopes.
pub(super) const GREY: RGBColor = RGBColor(0x88, 0x88, 0x88);

// The Okabe-Ito palette, distinguishable by the colour-blind.
pub(super) const ORANGE: RGBColor = RGBColor(0xe6, 0x9f, 0x00);
pub(super) const SKY: RGBColor = RGBColor(0x56, 0xb4, 0xe9);
pub(super) const GREEN: RGBColor = RGBColor(0x00, 0x9e, 0x73);
pub(super) const BLUE: RGBColor = RGBColor(0x00, 0x72, 0xb2);
pub(super) const VERMILION: RGBColor = RGBColor(0xd5, 0x5e, 0x00);
pub(super) const PURPLE: RGBColor = RGBColor(0xcc, 0x79, 0xa7);
/// A fault's colour.
pub(super) const FAULT: RGBColor = RGBColor(0xb0, 0x00, 0x20);

/// Returns the style of text that begins at its position and is centred vertically.
pub(super) fn text(size: f64) -> TextStyle<'static> {
    TextStyle::from((FONT, size).into_font())
        .color(&INK)
        .pos(Pos::new(HPos::Left, VPos::Center))
}

/// The same, bold.
pub(super) fn heading(size: f64) -> TextStyle<'static> {
    TextStyle::from((FONT, size, FontStyle::Bold).into_font())
        .color(&INK)
        .pos(Pos::new(HPos::Left, VPos::Center))
}

/// Returns the length of a text in pixels.
pub(super) fn length(text: &str, style: &TextStyle<'_>) -> i32 {
    // The built-in font has a size for any text.
    let size = style.font.box_size(text);
    size.map_or(0, |(width, _)| width as i32)
}

/// Formats a number without the digits that come from binary rounding.
pub(super) fn number(value: f64) -> String {
    rounded(value, -6).to_string()
}

/// Rounds a number to the place of this power of ten, never to a negative zero.
pub(super) fn rounded(value: f64, power: i32) -> f64 {
    let per_unit = 10_f64.powi(-power);
    (value * per_unit).round() / per_unit + 0.0
}
