//! The table as it is printed: equal sightings in a row as one, or each on its own.

use std::io::{self, Write};

use siskin_control::input::signal::Signal;

use super::Options;
use super::row::{HEAD, Row};
use super::summary::Summary;
use super::track::Sighting;

/// A table that is being printed.
pub(super) struct Table<W> {
    signal: Signal,
    /// Each sighting on a line of its own.
    all: bool,
    /// One JSON object a line.
    json: bool,
    /// It may still be joined by the next sighting.
    row: Option<Row>,
    out: W,
}

impl<W: Write> Table<W> {
    pub(super) fn begin(signal: Signal, options: &Options, mut out: W) -> io::Result<Self> {
        if !options.json {
            writeln!(out, "{HEAD}")?;
        }
        Ok(Self {
            signal,
            all: options.all,
            json: options.json,
            row: None,
            out,
        })
    }

    pub(super) fn add(&mut self, sighting: Sighting) -> io::Result<()> {
        let other = match &mut self.row {
            Some(row) if !self.all => row.join(sighting),
            _ => Some(sighting),
        };
        match other {
            Some(sighting) => {
                let row = self.row.replace(Row::new(self.signal, sighting));
                self.print(row)
            }
            None => Ok(()),
        }
    }

    /// The last row, and what it all comes to, sampled at this rate if that is known.
    pub(super) fn finish(mut self, summary: &Summary, sample_hz: Option<f64>) -> io::Result<()> {
        let row = self.row.take();
        self.print(row)?;
        if self.json {
            writeln!(self.out, "{}", summary.json(sample_hz))?;
        } else {
            writeln!(self.out)?;
            summary.print(&mut self.out, sample_hz)?;
        }
        self.out.flush()
    }

    fn print(&mut self, row: Option<Row>) -> io::Result<()> {
        match row {
            Some(row) if self.json => writeln!(self.out, "{}", row.json()),
            Some(row) => writeln!(self.out, "{}", row.line()),
            None => Ok(()),
        }
    }
}
