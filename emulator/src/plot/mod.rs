//! Pictures of recordings, and [`chart`]s and tables ([`grid`]) of anything else.

mod canvas;
pub mod chart;
mod error;
mod figure;
pub mod grid;
mod phases;
mod read;
mod reduce;
mod style;
#[cfg(test)]
mod tests;

use std::path::Path;

use canvas::Format;
pub use error::PlotError;
use figure::{COLUMNS, figure};
use read::Recording;

/// Draws the recording at `record` to `picture`, an `.svg` or a `.png`: speeds, currents, voltages
/// and the angle error over time, with the drive's phases behind them.
///
/// # Errors
/// The extension has no format, the recording cannot be read, or the picture cannot be written.
pub fn plot(record: &Path, picture: &Path) -> Result<(), PlotError> {
    let format = Format::of(picture)?;
    format.write(&figure(&Recording::read(record, COLUMNS)?), picture)
}
