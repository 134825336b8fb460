//! Runs as a table, one row each, for pandas, Polars, DuckDB or a spreadsheet.
//!
//! The rows are in run order, however the runs were parallelised, and nothing in them depends on the machine: equal
//! files give equal tables.

mod csv;
#[cfg(feature = "parquet")]
mod parquet;
mod row;

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use crate::record::RecordError;
use row::columns;

pub use row::{Cell, Row};

/// A table with an open file.
pub struct Table {
    path: PathBuf,
    file: File,
    write: fn(File, &[String], &[Row]) -> io::Result<()>,
}

impl Table {
    /// Creates a table at `path`, overwriting what is there.
    ///
    /// # Errors
    /// The extension has no format, or the file cannot be written.
    pub fn create(path: &Path) -> Result<Self, RecordError> {
        let extension = path.extension().and_then(|extension| extension.to_str());
        let write = match extension {
            Some("csv") => csv::write,
            #[cfg(feature = "parquet")]
            Some("parquet") => parquet::write,
            #[cfg(not(feature = "parquet"))]
            Some("parquet") => return Err(RecordError::NoParquet(path.to_owned())),
            _ => return Err(RecordError::Table(path.to_owned())),
        };
        let path = path.to_owned();
        match File::create(&path) {
            Ok(file) => Ok(Self { path, file, write }),
            Err(source) => Err(RecordError::Write { path, source }),
        }
    }

    /// Writes the rows.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(self, rows: &[Row]) -> Result<(), RecordError> {
        let written = (self.write)(self.file, &columns(rows), rows);
        written.map_err(|source| RecordError::Write {
            path: self.path,
            source,
        })
    }
}
