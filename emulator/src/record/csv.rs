//! Text, one line per control period.

use std::fs::File;
use std::io;

use super::row::Row;
use super::sink::Sink;
use crate::rig::{Period, Rig};
use crate::surroundings::Passage;

/// Bytes between two writes to the file: a few hundred periods.
const BUFFER_BYTES: usize = 64 * 1024;

/// A CSV file.
pub(super) struct Csv(csv::Writer<File>);

impl Csv {
    pub(super) fn new(file: File) -> io::Result<Self> {
        let mut writer = csv::WriterBuilder::new()
            .has_headers(false)
            .buffer_capacity(BUFFER_BYTES)
            .from_writer(file);
        // A run that ends before its first period still leaves a recording.
        writer.write_record(Row::COLUMNS)?;
        Ok(Self(writer))
    }
}

impl Sink for Csv {
    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) -> io::Result<()> {
        Ok(self.0.serialize(Row::of(t_s, period, rig))?)
    }

    fn passage(&mut self, t_s: f64, passage: &Passage) -> io::Result<()> {
        Ok(self.0.serialize(Row::outside(t_s, &passage.motion))?)
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.0.flush()
    }
}
