//! Pictures other than recordings: curves and maps of any quantities, several to a sheet.

mod curve;
mod map;
mod panel;
mod scale;
mod sheet;
#[cfg(test)]
mod tests;

use std::path::Path;

use plotters::style::RGBColor;

use super::canvas::Format;
use super::error::PlotError;

/// Default size of a panel.
pub const PANEL: (u32, u32) = (1200, 900);

/// Default line width.
const LINE: u32 = 5;

/// A picture: panels in rows and columns, under a title.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Stem of the file name, as `bosso-3`.
    pub name: String,
    /// What it shows, and where in the paper.
    pub title: String,
    /// Panels per row; the rows follow from their number.
    pub columns: usize,
    /// Size of a panel, pixels of the PNG.
    pub panel: (u32, u32),
    /// The panels, row by row.
    pub panels: Vec<Panel>,
}

/// One set of axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// What it shows.
    pub title: String,
    /// The horizontal quantity.
    pub x: Axis,
    /// The vertical quantity.
    pub y: Axis,
    /// Colours behind the curves, for a third quantity.
    pub map: Option<Map>,
    /// The curves, each with its entry in the legend.
    pub curves: Vec<Curve>,
    /// Stretches of the x axis marked behind the curves.
    pub stretches: Vec<Stretch>,
    /// Positions on the x axis where something goes wrong.
    pub faults: Vec<f64>,
}

/// A stretch of the x axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// Its name, above the axes; none if empty.
    pub name: &'static str,
    /// Its ends.
    pub ends: (f64, f64),
    /// The colour behind the curves.
    pub tint: RGBColor,
}

/// An axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The quantity with its unit, as `speed (rpm)`; an x axis without one shares that of the panel below.
    pub label: String,
    /// Ends; `None` for the range of the curves.
    pub range: Option<(f64, f64)>,
    /// Whether equal lengths are equal ratios.
    pub logarithmic: bool,
}

/// A curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Its entry in the legend.
    pub name: String,
    /// The points; a non-finite one is a gap.
    pub points: Vec<(f64, f64)>,
    /// The range of the samples about each point; empty if they are the points.
    pub spread: Vec<(f64, f64)>,
    /// How it is drawn.
    pub look: CurveLook,
    /// Its colour, if not the next of the palette.
    pub colour: Option<RGBColor>,
    /// Width of a line.
    pub width: u32,
}

/// How a curve is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CurveLook {
    /// A line: measured here.
    #[default]
    Line,
    /// A dashed line: a bound, a formula or a reference.
    Dashed,
    /// A dot at each point: samples, or the paper's printed values.
    Dots,
    /// The range of the samples, without a line.
    Band,
}

/// A third quantity over a grid of the two axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// The quantity with its unit.
    pub label: String,
    /// Positions of the columns on the x axis, rising.
    pub x: Vec<f64>,
    /// Positions of the rows on the y axis, rising.
    pub y: Vec<f64>,
    /// Rows of values from the lowest y, each from the lowest x; non-finite values are left blank.
    pub rows: Vec<Vec<f64>>,
    /// The range of the colours; `None` for that of the values.
    pub range: Option<(f64, f64)>,
}

impl Map {
    /// Gives two maps to be compared the same colour scale.
    pub fn alike(mut self, mut other: Self) -> [Self; 2] {
        let values = self.rows.iter().chain(&other.rows).flatten();
        let finite = values.filter(|value| value.is_finite());
        let range = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(*value), high.max(*value))
        });
        (self.range, other.range) = (Some(range), Some(range));
        [self, other]
    }
}

impl Panel {
    /// Creates a panel of curves over two axes.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis, curves: Vec<Curve>) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            map: None,
            curves,
            stretches: Vec::new(),
            faults: Vec::new(),
        }
    }
}

impl Curve {
    /// Creates a curve of measurements.
    pub fn line(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(name, CurveLook::Line, points)
    }

    /// Creates a bound, a formula or a reference.
    pub fn dashed(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(name, CurveLook::Dashed, points)
    }

    /// Creates single values: samples, or the paper's.
    pub fn dots(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(name, CurveLook::Dots, points)
    }

    fn new(
        name: impl Into<String>,
        look: CurveLook,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        Self {
            name: name.into(),
            points: points.into_iter().collect(),
            spread: Vec::new(),
            look,
            colour: None,
            width: LINE,
        }
    }
}

impl Axis {
    /// Creates a linear axis over the range of the curves.
    pub fn new(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            range: None,
            logarithmic: false,
        }
    }
}

/// Creates a folder for pictures if there is none, and checks that a file can be written there.
///
/// # Errors
/// The folder cannot be created or written to.
pub fn prepare(folder: &Path) -> Result<(), PlotError> {
    let probe = folder.join(".probe");
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(&probe, ""))
        .and_then(|()| std::fs::remove_file(&probe))
        .map_err(|source| PlotError::Write {
            path: folder.to_owned(),
            source,
        })
}

/// Draws figures into a folder, see [`prepare`], each as SVG and PNG.
///
/// # Errors
/// A picture cannot be written.
pub fn draw(figures: &[Figure], folder: &Path) -> Result<(), PlotError> {
    for figure in figures {
        for (format, extension) in [(Format::Svg, "svg"), (Format::Png, "png")] {
            let path = folder.join(format!("{}.{extension}", figure.name));
            format.write(figure, &path)?;
        }
    }
    Ok(())
}
