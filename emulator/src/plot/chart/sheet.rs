//! The sheet: a title, and below it the panels row by row.

use plotters::backend::DrawingBackend;
use plotters::style::WHITE;

use super::Figure;
use super::panel::{Header, wrap};
use crate::plot::canvas::{Area, Drawn, Picture};
use crate::plot::style::heading;

/// The least width, of a panel alone.
const ALONE: u32 = 1600;
/// A line of the title and its left end.
const TITLE: u32 = 56;
const LEFT: u32 = 40;
const TITLE_SIZE: f64 = 36.0;

impl Figure {
    fn columns(&self) -> u32 {
        self.columns.clamp(1, self.panels.len().max(1)) as u32
    }

    fn rows(&self) -> u32 {
        (self.panels.len() as u32).div_ceil(self.columns())
    }

    fn width(&self) -> u32 {
        (self.columns() * self.panel.0).max(ALONE)
    }

    fn title_lines(&self) -> Vec<String> {
        wrap(
            &self.title,
            &heading(TITLE_SIZE),
            (self.width() - 2 * LEFT) as i32,
        )
    }

    fn title_height(&self) -> u32 {
        TITLE * self.title_lines().len() as u32 + 30
    }
}

impl Picture for Figure {
    fn size(&self) -> (u32, u32) {
        (
            self.width(),
            self.title_height() + self.rows() * self.panel.1,
        )
    }

    fn draw<B: DrawingBackend>(&self, root: &Area<B>) -> Drawn<B> {
        root.fill(&WHITE)?;
        let mut middle = 15 + TITLE as i32 / 2;
        for line in self.title_lines() {
            root.draw_text(&line, &heading(TITLE_SIZE), (LEFT as i32, middle))?;
            middle += TITLE as i32;
        }
        let (_, below) = root.split_vertically(self.title_height());
        let columns = self.columns() as usize;
        let areas = below.split_evenly((self.rows() as usize, columns));
        let width = self.width() / self.columns();
        for (panels, areas) in self.panels.chunks(columns).zip(areas.chunks(columns)) {
            let headers = panels.iter().map(|panel| panel.header(width));
            let headers: Vec<_> = headers.collect();
            let top = headers.iter().map(Header::height).max().unwrap_or(0);
            for ((panel, header), area) in panels.iter().zip(&headers).zip(areas) {
                panel.draw(area, header, top)?;
            }
        }
        Ok(())
    }
}
