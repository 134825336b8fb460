//! A table as a picture: named rows and columns, and in each cell a colour and a few words.

use std::path::Path;

use plotters::backend::DrawingBackend;
use plotters::element::Rectangle;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor, TextStyle, WHITE};

use super::canvas::{Area, Drawn, Format, Picture};
use super::error::PlotError;
use super::style::{FAULT, GRID, INK, heading, length, text};

/// Width of the row names, and of a column, pixels.
const NAMES: i32 = 330;
const COLUMN: i32 = 196;
/// Height of a row, and of a line in it.
const ROW: i32 = 100;
const LINE: i32 = 29;
/// Height of the title, of the group and column names, and of the key.
const TITLE: i32 = 76;
const HEAD: i32 = 88;
const KEY: i32 = 70;
/// Space around everything, and between two groups of columns.
const EDGE: i32 = 24;
const GAP: i32 = 14;
/// Font size in a cell.
const LETTERS: f64 = 22.0;

/// A table.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// What it shows.
    pub title: String,
    /// Groups of columns with the column names.
    pub groups: Vec<(String, Vec<String>)>,
    /// Rows with their names; a row has a cell for each column.
    pub rows: Vec<(String, Vec<Place>)>,
    /// What the colours mean.
    pub key: Vec<(RGBColor, String)>,
}

/// A cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Its fill.
    pub tint: RGBColor,
    /// Lines of text, three at most.
    pub lines: Vec<String>,
    /// Whether the last line is a warning, and the cell has a frame.
    pub warns: bool,
}

impl Grid {
    /// Draws it to an `.svg` or a `.png`.
    ///
    /// # Errors
    /// The extension has no format, or the picture cannot be written.
    pub fn draw_to(&self, picture: &Path) -> Result<(), PlotError> {
        Format::of(picture)?.write(self, picture)
    }

    /// Returns the left end of a column in a group.
    fn left(&self, group: usize, column: usize) -> i32 {
        let before: usize = self.groups[..group]
            .iter()
            .map(|(_, names)| names.len())
            .sum();
        EDGE + NAMES + GAP * group as i32 + COLUMN * (before + column) as i32
    }

    /// Returns the left ends of the columns, in order.
    fn lefts(&self) -> Vec<i32> {
        let groups = self.groups.iter().enumerate();
        let lefts = groups
            .flat_map(|(group, (_, names))| (0..names.len()).map(move |column| (group, column)));
        lefts
            .map(|(group, column)| self.left(group, column))
            .collect()
    }
}

impl Picture for Grid {
    fn size(&self) -> (u32, u32) {
        let right = self
            .lefts()
            .last()
            .map_or(EDGE + NAMES, |left| left + COLUMN);
        let bottom = EDGE + TITLE + HEAD + ROW * self.rows.len() as i32 + KEY;
        ((right + EDGE) as u32, (bottom + EDGE) as u32)
    }

    fn draw<B: DrawingBackend>(&self, root: &Area<B>) -> Drawn<B> {
        root.fill(&WHITE)?;
        root.draw_text(&self.title, &heading(36.0), (EDGE, EDGE + TITLE / 2))?;
        let top = EDGE + TITLE;
        for (group, (name, columns)) in self.groups.iter().enumerate() {
            let left = self.left(group, 0);
            root.draw_text(name, &heading(28.0), (left, top + HEAD / 4))?;
            for (column, name) in columns.iter().enumerate() {
                let at = (self.left(group, column) + COLUMN / 2, top + 3 * HEAD / 4);
                root.draw_text(name, &centred(26.0), at)?;
            }
        }
        let lefts = self.lefts();
        for (row, (name, places)) in self.rows.iter().enumerate() {
            let top = top + HEAD + ROW * row as i32;
            root.draw_text(name, &text(26.0), (EDGE, top + ROW / 2))?;
            for (place, left) in places.iter().zip(&lefts) {
                place.draw(root, (*left, top))?;
            }
        }
        let middle = top + HEAD + ROW * self.rows.len() as i32 + KEY / 2;
        let mut left = EDGE + NAMES;
        for (tint, meaning) in &self.key {
            let corners = [(left, middle - 16), (left + 44, middle + 16)];
            root.draw(&Rectangle::new(corners, tint.filled()))?;
            root.draw_text(meaning, &text(26.0), (left + 56, middle))?;
            left += 56 + length(meaning, &text(26.0)) + 44;
        }
        Ok(())
    }
}

impl Place {
    fn draw<B: DrawingBackend>(&self, root: &Area<B>, (left, top): (i32, i32)) -> Drawn<B> {
        let corners = [(left + 1, top + 1), (left + COLUMN - 2, top + ROW - 2)];
        root.draw(&Rectangle::new(corners, self.tint.filled()))?;
        let frame = if self.warns {
            FAULT.stroke_width(4)
        } else {
            GRID.stroke_width(1)
        };
        root.draw(&Rectangle::new(corners, frame))?;
        let lines = self.lines.len() as i32;
        for (line, words) in self.lines.iter().enumerate() {
            let line = line as i32;
            let middle = top + ROW / 2 + (2 * line - lines + 1) * LINE / 2;
            let colour = if self.warns && line + 1 == lines {
                FAULT
            } else {
                INK
            };
            let style = centred(LETTERS).color(&colour);
            root.draw_text(words, &style, (left + COLUMN / 2, middle))?;
        }
        Ok(())
    }
}

/// Returns a style centred on its position.
fn centred(size: f64) -> TextStyle<'static> {
    text(size).pos(Pos::new(HPos::Center, VPos::Center))
}
