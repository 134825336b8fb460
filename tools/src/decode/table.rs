//! Prints the table: one line per run of equal sightings, or one per sighting.

use std::io::{self, Write};

use siskin_throttle::signal::Signal;

use super::Options;
use super::row::{HEAD, Row};
use super::summary::Summary;
use super::track::Sighting;

/// A table being printed.
pub(super) struct Table<W> {
    signal: Signal,
    /// Print each sighting on its own line.
    all: bool,
    /// Print one JSON object per line.
    json: bool,
    /// The next sighting may still be merged into this row.
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

    /// Prints the last row and the summary, with the sample rate if it is known.
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
