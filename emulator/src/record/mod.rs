//! Recordings of a run, for other programs.
//!
//! The extension of the path selects the format: `.csv` and `.parquet` hold the columns of [`Row`],
//! one line per control period; `.vcd` the wires of the bridge, of the throttle and of the Hall
//! sensors with every edge; `.tlog` the MAVLink frames of both directions.

mod csv;
#[cfg(feature = "parquet")]
pub(crate) mod parquet;
mod row;
mod sink;
#[cfg(test)]
mod tests;
mod tlog;
#[cfg(feature = "plot")]
pub(crate) mod trip;
mod vcd;

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use thiserror::Error;

use crate::plant::Gate;
use crate::rig::{Period, Rig};
use crate::surroundings::Passage;

use sink::Sink;

pub use row::Row;

/// Start of an offline run by the clock of its log: 2020-01-01 00:00 UTC, so that equal runs give
/// equal files.
const OFFLINE_START: Duration = Duration::from_secs(1_577_836_800);

/// Why there is no recording.
#[derive(Debug, Error)]
pub enum RecordError {
    /// No format has this extension.
    #[error(
        "cannot record to {}: the name must end in .csv, .parquet, .vcd or .tlog", .0.display()
    )]
    Extension(PathBuf),
    /// No table format has this extension.
    #[error("--table {}: the name must end in .csv or .parquet", .0.display())]
    Table(PathBuf),
    /// The format is not in this build.
    #[error("cannot record to {}: {}", .0.display(), NO_PARQUET)]
    NoParquet(PathBuf),
    /// The file cannot be written.
    #[error("cannot record to {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
}

/// What to do if a build cannot write or read Parquet.
pub(crate) const NO_PARQUET: &str = "this build has no Parquet; build it with --features parquet";

/// Writes a recording.
pub struct Recorder {
    path: PathBuf,
    sink: Box<dyn Sink>,
}

impl Recorder {
    /// Creates a recording of an offline run at `path`, overwriting what is there.
    ///
    /// # Errors
    /// The extension has no format, or the file cannot be written.
    pub fn create(path: &Path) -> Result<Self, RecordError> {
        Self::from(path, OFFLINE_START)
    }

    /// Creates one of a run that begins now.
    ///
    /// # Errors
    /// Likewise.
    pub fn live(path: &Path) -> Result<Self, RecordError> {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        // A clock before 1970 is not set.
        Self::from(path, now.unwrap_or(OFFLINE_START))
    }

    /// Creates a recording of a run that begins at `start` after 1970.
    fn from(path: &Path, start: Duration) -> Result<Self, RecordError> {
        let error = |source| RecordError::Write {
            path: path.to_owned(),
            source,
        };
        let file = || File::create(path);
        let extension = path.extension().and_then(|extension| extension.to_str());
        let sink: io::Result<Box<dyn Sink>> = match extension {
            Some("csv") => file()
                .and_then(csv::Csv::new)
                .map(|sink| Box::new(sink) as _),
            Some("vcd") => file()
                .and_then(vcd::Vcd::new)
                .map(|sink| Box::new(sink) as _),
            Some("tlog") => file().map(|file| Box::new(tlog::Tlog::new(file, start)) as _),
            #[cfg(feature = "parquet")]
            Some("parquet") => file()
                .and_then(parquet::Parquet::new)
                .map(|sink| Box::new(sink) as _),
            #[cfg(not(feature = "parquet"))]
            Some("parquet") => return Err(RecordError::NoParquet(path.to_owned())),
            _ => return Err(RecordError::Extension(path.to_owned())),
        };
        Ok(Self {
            path: path.to_owned(),
            sink: sink.map_err(error)?,
        })
    }

    /// Records the control period that began at `t_s`, and the control's response.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) -> Result<(), RecordError> {
        let written = self.sink.period(t_s, period, rig);
        written.map_err(|source| self.error(source))
    }

    /// Records the PWM period that began at `t_s`, of a machine whose control is not visible.
    ///
    /// # Errors
    /// The file cannot be written, or needs the control.
    pub fn passage(&mut self, t_s: f64, passage: &Passage) -> Result<(), RecordError> {
        let written = self.sink.passage(t_s, passage);
        written.map_err(|source| self.error(source))
    }

    /// Records a change of a leg's gates, after the start of the next such period reported.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn gates(&mut self, time_ns: u64, leg: usize, gate: Gate) -> Result<(), RecordError> {
        let written = self.sink.gates(time_ns, leg, gate);
        written.map_err(|source| self.error(source))
    }

    /// Records a change of the throttle wire, before the next period.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn edge(&mut self, time_ns: u64, level: bool) -> Result<(), RecordError> {
        let written = self.sink.edge(time_ns, level);
        written.map_err(|source| self.error(source))
    }

    /// Records a whole MAVLink frame, sent or received.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn frame(&mut self, time_ns: u64, frame: &[u8]) -> Result<(), RecordError> {
        let written = self.sink.frame(time_ns, frame);
        written.map_err(|source| self.error(source))
    }

    /// Writes what is still in memory.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(self) -> Result<(), RecordError> {
        let Self { path, sink } = self;
        sink.finish()
            .map_err(|source| RecordError::Write { path, source })
    }

    fn error(&self, source: io::Error) -> RecordError {
        RecordError::Write {
            path: self.path.clone(),
            source,
        }
    }
}
