//! Why there is no picture.

use std::path::PathBuf;

use thiserror::Error;

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
        /// What is wrong.
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
