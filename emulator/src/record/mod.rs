//! Recordings of a run: one line a control period.
//!
//! The extension of the path selects the format; `.csv` is text with the columns of [`Row`].

mod row;
#[cfg(test)]
mod tests;

use std::ffi::OsStr;
use std::fs::File;
use std::path::{Path, PathBuf};

use siskin_control::drive::Snapshot;
use thiserror::Error;

use crate::rig::Period;
use crate::shaft::Units;

pub use row::Row;

/// Bytes between two writes to the file: a few hundred periods.
const BUFFER_BYTES: usize = 64 * 1024;

/// Why there is no recording.
#[derive(Debug, Error)]
pub enum RecordError {
    /// No format has this extension.
    #[error("cannot record to {}: the name must end in .csv", .0.display())]
    Extension(PathBuf),
    /// The file cannot be written.
    #[error("cannot record to {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

/// Writes a recording.
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    csv: csv::Writer<File>,
}

impl Recorder {
    /// A new recording at `path`; what stood there is lost.
    ///
    /// # Errors
    /// An extension without a format, or a file that cannot be written.
    pub fn create(path: &Path) -> Result<Self, RecordError> {
        if path.extension() != Some(OsStr::new("csv")) {
            return Err(RecordError::Extension(path.to_owned()));
        }
        let file = File::create(path).map_err(|source| RecordError::Write {
            path: path.to_owned(),
            source,
        })?;
        let mut recorder = Self {
            path: path.to_owned(),
            csv: csv::WriterBuilder::new()
                .has_headers(false)
                .buffer_capacity(BUFFER_BYTES)
                .from_writer(file),
        };
        // A run that ends before its first period still leaves a recording.
        let header = recorder.csv.write_record(Row::COLUMNS);
        header.map_err(|error| recorder.error(error.into()))?;
        Ok(recorder)
    }

    /// Appends the control period that began at `t_s`, and what the control made of it.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(
        &mut self,
        t_s: f64,
        period: &Period,
        snapshot: &Snapshot,
        units: Units,
    ) -> Result<(), RecordError> {
        let written = self.csv.serialize(Row::new(t_s, period, snapshot, units));
        written.map_err(|error| self.error(error.into()))
    }

    /// Writes what is still in memory.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(mut self) -> Result<(), RecordError> {
        let flushed = self.csv.flush();
        flushed.map_err(|source| self.error(source))
    }

    fn error(&self, source: std::io::Error) -> RecordError {
        RecordError::Write {
            path: self.path.clone(),
            source,
        }
    }
}
