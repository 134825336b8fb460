//! The table as text.

use std::fs::File;
use std::io;

use super::row::{Cell, Row};

/// Writes numbers as the shortest text that parses to the same double.
pub(super) fn write(file: File, columns: &[String], rows: &[Row]) -> io::Result<()> {
    let mut writer = ::csv::Writer::from_writer(file);
    writer.write_record(columns)?;
    for row in rows {
        writer.write_record(columns.iter().map(|column| text(row.cell(column))))?;
    }
    writer.flush()
}

fn text(cell: &Cell) -> String {
    match cell {
        Cell::Nothing => String::new(),
        Cell::Flag(flag) => flag.to_string(),
        Cell::Whole(number) => number.to_string(),
        Cell::Number(number) => number.to_string(),
        Cell::Text(text) => text.clone(),
    }
}
