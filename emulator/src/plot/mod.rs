//! Pictures of recordings, and [`chart`]s of anything else.

mod canvas;
pub mod chart;
mod figure;
mod panel;
mod read;
mod reduce;
mod style;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use thiserror::Error;

use canvas::Format;
use figure::COLUMNS;
use read::Recording;

/// Why there is no picture.
#[derive(Debug, Error)]
pub enum PlotError {
    /// No picture has this extension.
    #[error("cannot draw {}: the name must end in .svg or .png", .0.display())]
    Extension(PathBuf),
    /// The recording cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The recording.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is something else.
    #[error("{} is no recording that can be drawn: {reason}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is amiss.
        reason: String,
    },
    /// The drawing failed.
    #[error("cannot draw: {0}")]
    Draw(String),
    /// The picture cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The picture.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

/// Draws the recording at `record` to `picture`, an `.svg` or a `.png`: speeds, currents, voltages
/// and the angle error over the time, with the phases of the drive behind them.
///
/// # Errors
/// An extension without a format, a recording that cannot be read, a picture that cannot be
/// written.
pub fn plot(record: &Path, picture: &Path) -> Result<(), PlotError> {
    let format = Format::of(picture)?;
    format.write(&Recording::read(record, COLUMNS)?, picture)
}
