//! The table as Apache Parquet: each column has the kind of its values, or is text if they differ.

use std::fs::File;
use std::io;
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::Type;

use super::row::{Cell, Row};

/// How a column is stored.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Flag,
    Whole,
    Number,
    Text,
}

pub(super) fn write(file: File, columns: &[String], rows: &[Row]) -> io::Result<()> {
    Ok(write_table(file, columns, rows)?)
}

fn write_table(file: File, columns: &[String], rows: &[Row]) -> Result<(), ParquetError> {
    let columns: Vec<_> = columns
        .iter()
        .map(|name| (name, kind(name, rows)))
        .collect();
    let fields = columns.iter().map(|(name, kind)| kind.field(name));
    let fields = fields.collect::<Result<Vec<_>, _>>()?;
    let schema = Type::group_type_builder("siskin")
        .with_fields(fields)
        .build()?;
    let properties = WriterProperties::builder().set_compression(Compression::LZ4_RAW);
    let properties = Arc::new(properties.build());
    let mut writer = SerializedFileWriter::new(file, Arc::new(schema), properties)?;
    let mut group = writer.next_row_group()?;
    for (name, kind) in columns {
        let Some(mut column) = group.next_column()? else {
            return Err(ParquetError::General("a column too many".to_owned()));
        };
        let cells: Vec<_> = rows.iter().map(|row| row.cell(name)).collect();
        let to = &mut column;
        match kind {
            Kind::Flag => fill::<BoolType>(to, &cells, |cell| match cell {
                Cell::Flag(flag) => Some(*flag),
                _ => None,
            })?,
            Kind::Whole => fill::<Int64Type>(to, &cells, |cell| match cell {
                Cell::Whole(number) => Some(*number as i64),
                _ => None,
            })?,
            Kind::Number => fill::<DoubleType>(to, &cells, |cell| match cell {
                Cell::Number(number) => Some(*number),
                _ => None,
            })?,
            Kind::Text => {
                fill::<ByteArrayType>(to, &cells, |cell| Some(text(cell)?.into_bytes().into()))?;
            }
        }
        column.close()?;
    }
    group.close()?;
    writer.close()?;
    Ok(())
}

/// Returns the kind of a column's values.
fn kind(column: &str, rows: &[Row]) -> Kind {
    let kinds = rows.iter().filter_map(|row| match row.cell(column) {
        Cell::Nothing => None,
        Cell::Flag(_) => Some(Kind::Flag),
        Cell::Whole(_) => Some(Kind::Whole),
        Cell::Number(_) => Some(Kind::Number),
        Cell::Text(_) => Some(Kind::Text),
    });
    // Figures without a value in any run are numbers.
    kinds
        .reduce(|kind, other| if kind == other { kind } else { Kind::Text })
        .unwrap_or(Kind::Number)
}

fn text(cell: &Cell) -> Option<String> {
    match cell {
        Cell::Nothing => None,
        Cell::Flag(flag) => Some(flag.to_string()),
        Cell::Whole(number) => Some(number.to_string()),
        Cell::Number(number) => Some(number.to_string()),
        Cell::Text(text) => Some(text.clone()),
    }
}

impl Kind {
    fn field(self, name: &str) -> Result<Arc<Type>, ParquetError> {
        let (physical, logical) = match self {
            Self::Flag => (Physical::BOOLEAN, None),
            Self::Whole => (Physical::INT64, Some(LogicalType::integer(64, false))),
            Self::Number => (Physical::DOUBLE, None),
            Self::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let field = Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical);
        Ok(Arc::new(field.build()?))
    }
}

fn fill<T: DataType>(
    column: &mut SerializedColumnWriter<'_>,
    cells: &[&Cell],
    value: impl Fn(&Cell) -> Option<T::T>,
) -> Result<(), ParquetError> {
    let cells: Vec<_> = cells.iter().map(|cell| value(cell)).collect();
    let there: Vec<_> = cells.iter().map(|cell| cell.is_some().into()).collect();
    let values: Vec<_> = cells.into_iter().flatten().collect();
    column
        .typed::<T>()
        .write_batch(&values, Some(&there), None)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::SerializedFileReader;

    use super::*;

    #[test]
    fn a_table_is_read_back() {
        let cell = |name: &str, cell| (name.to_owned(), cell);
        let rows = [
            Row(vec![
                cell("seed", Cell::Whole(u64::MAX)),
                cell("signal.0.rpm", Cell::Number(3e3)),
                cell("mixed", Cell::Number(0.5)),
                cell("held", Cell::Flag(true)),
            ]),
            Row(vec![
                cell("seed", Cell::Whole(2)),
                cell("signal.0.rpm", Cell::Nothing),
                cell("mixed", Cell::Text("6s".to_owned())),
                cell("held", Cell::Flag(false)),
            ]),
        ];
        let columns = crate::scenario::table::row::columns(&rows);
        let file = tempfile::tempfile().unwrap();
        write(file.try_clone().unwrap(), &columns, &rows).unwrap();
        let reader = SerializedFileReader::new(file).unwrap();
        let read: Vec<_> = reader
            .into_iter()
            .map(|row| row.unwrap().to_string())
            .collect();
        let wanted = [
            r#"{seed: 18446744073709551615, signal.0.rpm: 3000.0, mixed: "0.5", held: true}"#,
            r#"{seed: 2, signal.0.rpm: null, mixed: "6s", held: false}"#,
        ];
        assert_eq!(read, wanted);
    }
}
