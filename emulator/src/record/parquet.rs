//! Apache Parquet: the columns of the CSV, packed, for pandas, Polars and DuckDB. Each column's
//! unit is in the file's metadata as `unit.COLUMN`.

use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::{
    SerializedColumnWriter, SerializedFileWriter, SerializedRowGroupWriter,
};
use parquet::record::RowAccessor;
use parquet::schema::parser::parse_message_type;
use serde::de::IntoDeserializer;
use serde::de::value::Error as NameError;

use super::row::Row;
use super::sink::Sink;
use crate::rig::{Period, Rig};
use crate::surroundings::Passage;

/// Rows buffered and written together: less than 10 MB.
const GROUP_ROWS: usize = 65_536;

/// How a column is stored, and where its values are in a row.
#[derive(Clone, Copy)]
enum Column {
    Double(fn(&Row) -> f64),
    Phase,
    Faults,
    Single(fn(&Row) -> f32),
    /// From the control, which every recording in this format has.
    Inside(fn(&Row) -> Option<f32>),
    Optional(fn(&Row) -> Option<f32>),
}
use Column::{Double, Inside, Optional, Single};

/// The columns of [`Row`] in order, each with its unit.
const COLUMNS: [(&str, &str, Column); Row::COLUMNS.len()] = [
    ("t_s", "s", Double(|row| row.t_s)),
    ("phase", "", Column::Phase),
    ("faults", "", Column::Faults),
    ("rpm", "rpm", Single(|row| row.rpm)),
    ("rpm_est", "rpm", Inside(|row| row.rpm_est)),
    ("rpm_ref", "rpm", Inside(|row| row.rpm_ref)),
    ("angle_deg", "deg", Single(|row| row.angle_deg)),
    ("angle_est_deg", "deg", Inside(|row| row.angle_est_deg)),
    ("angle_error_deg", "deg", Inside(|row| row.angle_error_deg)),
    ("i_a_a", "A", Single(|row| row.i_a_a)),
    ("i_b_a", "A", Single(|row| row.i_b_a)),
    ("i_c_a", "A", Single(|row| row.i_c_a)),
    ("i_d_a", "A", Inside(|row| row.i_d_a)),
    ("i_q_a", "A", Inside(|row| row.i_q_a)),
    ("u_d_v", "V", Inside(|row| row.u_d_v)),
    ("u_q_v", "V", Inside(|row| row.u_q_v)),
    ("duty_a", "1", Optional(|row| row.duty_a)),
    ("duty_b", "1", Optional(|row| row.duty_b)),
    ("duty_c", "1", Optional(|row| row.duty_c)),
    ("bus_v", "V", Single(|row| row.bus_v)),
    ("bus_a", "A", Single(|row| row.bus_a)),
    ("torque_nm", "Nm", Single(|row| row.torque_nm)),
];

/// A Parquet file.
pub(super) struct Parquet {
    writer: SerializedFileWriter<File>,
    rows: Vec<Row>,
}

impl Parquet {
    pub(super) fn new(file: File) -> io::Result<Self> {
        let units = COLUMNS.iter().filter(|(_, unit, _)| !unit.is_empty());
        let units =
            units.map(|(name, unit, _)| KeyValue::new(format!("unit.{name}"), (*unit).to_owned()));
        let properties = WriterProperties::builder()
            .set_compression(Compression::LZ4_RAW)
            .set_key_value_metadata(Some(units.collect()))
            .build();
        let schema = parse_message_type(&schema())?;
        let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))?;
        Ok(Self {
            writer,
            rows: Vec::with_capacity(GROUP_ROWS),
        })
    }

    fn write(&mut self) -> Result<(), ParquetError> {
        let mut group = self.writer.next_row_group()?;
        for (_, _, column) in COLUMNS {
            column.write(&mut group, &self.rows)?;
        }
        group.close()?;
        self.rows.clear();
        Ok(())
    }
}

impl Sink for Parquet {
    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) -> io::Result<()> {
        self.rows.push(Row::of(t_s, period, rig));
        if self.rows.len() == GROUP_ROWS {
            self.write()?;
        }
        Ok(())
    }

    fn passage(&mut self, _t_s: f64, _passage: &Passage) -> io::Result<()> {
        Err(io::Error::other(
            "this format wants the control; give a .csv",
        ))
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        if !self.rows.is_empty() {
            self.write()?;
        }
        self.writer.close()?;
        Ok(())
    }
}

impl Column {
    fn write(
        self,
        group: &mut SerializedRowGroupWriter<'_, File>,
        rows: &[Row],
    ) -> Result<(), ParquetError> {
        let Some(mut column) = group.next_column()? else {
            return Err(ParquetError::General("a column too many".to_owned()));
        };
        let to = &mut column;
        match self {
            Double(get) => fill::<DoubleType>(to, rows.iter().map(get))?,
            Single(get) => fill::<FloatType>(to, rows.iter().map(get))?,
            Self::Faults => {
                let bits = rows.iter().filter_map(|row| row.faults);
                fill::<Int32Type>(to, bits.map(i32::from))?;
            }
            Self::Phase => {
                let names = rows
                    .iter()
                    .filter_map(Row::phase_name)
                    .map(String::into_bytes);
                fill::<ByteArrayType>(to, names.map(ByteArray::from))?;
            }
            Inside(get) => fill::<FloatType>(to, rows.iter().filter_map(get))?,
            Optional(get) => {
                let values: Vec<_> = rows.iter().filter_map(get).collect();
                let there: Vec<_> = rows.iter().map(|row| get(row).is_some().into()).collect();
                let column = to.typed::<FloatType>();
                column.write_batch(&values, Some(&there), None)?;
            }
        }
        column.close()
    }

    const fn kind(self) -> &'static str {
        match self {
            Double(_) => "required double",
            Single(_) | Inside(_) => "required float",
            Optional(_) => "optional float",
            Self::Faults => "required int32",
            Self::Phase => "required binary",
        }
    }

    const fn meaning(self) -> &'static str {
        match self {
            Self::Faults => " (INTEGER(8, false))",
            Self::Phase => " (UTF8)",
            Double(_) | Single(_) | Inside(_) | Optional(_) => "",
        }
    }
}

fn fill<T: DataType>(
    column: &mut SerializedColumnWriter<'_>,
    values: impl Iterator<Item = T::T>,
) -> Result<(), ParquetError> {
    let values: Vec<_> = values.collect();
    column.typed::<T>().write_batch(&values, None, None)?;
    Ok(())
}

fn schema() -> String {
    let columns =
        COLUMNS.map(|(name, _, column)| format!("{} {name}{};", column.kind(), column.meaning()));
    format!("message siskin {{ {} }}", columns.join(" "))
}

/// Reads the rows of the recording at `path`. An error of a row is a reason in one line.
///
/// # Errors
/// The file cannot be read, is not Parquet or lacks a column.
pub(crate) fn read(
    path: &Path,
) -> Result<impl Iterator<Item = Result<Row, String>> + use<>, ReadError> {
    let reader = SerializedFileReader::new(File::open(path)?)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let mut places = [0; Row::COLUMNS.len()];
    for (place, name) in places.iter_mut().zip(Row::COLUMNS) {
        let mut columns = schema.columns().iter();
        *place = columns
            .position(|column| column.name() == name)
            .ok_or_else(|| ReadError::Content(format!("it has no column {name}")))?;
    }
    Ok(reader.into_iter().map(move |row| {
        let row = row.map_err(line)?;
        row_of(&row, places).map_err(line)
    }))
}

/// Why a file cannot be read as Parquet.
pub(crate) enum ReadError {
    /// The file itself.
    Io(io::Error),
    /// Its contents; the reason in one line.
    Content(String),
}

impl From<io::Error> for ReadError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl From<ParquetError> for ReadError {
    fn from(error: ParquetError) -> Self {
        Self::Content(line(error))
    }
}

fn line(error: ParquetError) -> String {
    error.to_string().replace('\n', " ")
}

fn row_of(
    row: &parquet::record::Row,
    places: [usize; Row::COLUMNS.len()],
) -> Result<Row, ParquetError> {
    let mut places = places.into_iter();
    let mut next = || places.next().unwrap_or_default();
    Ok(Row {
        t_s: row.get_double(next())?,
        phase: Row::phase_named(row.get_string(next())?.as_str().into_deserializer())
            .map(Some)
            .map_err(|error: NameError| ParquetError::General(error.to_string()))?,
        faults: Some(row.get_ubyte(next())?),
        rpm: row.get_float(next())?,
        rpm_est: Some(row.get_float(next())?),
        rpm_ref: Some(row.get_float(next())?),
        angle_deg: row.get_float(next())?,
        angle_est_deg: Some(row.get_float(next())?),
        angle_error_deg: Some(row.get_float(next())?),
        i_a_a: row.get_float(next())?,
        i_b_a: row.get_float(next())?,
        i_c_a: row.get_float(next())?,
        i_d_a: Some(row.get_float(next())?),
        i_q_a: Some(row.get_float(next())?),
        u_d_v: Some(row.get_float(next())?),
        u_q_v: Some(row.get_float(next())?),
        duty_a: optional(row, next())?,
        duty_b: optional(row, next())?,
        duty_c: optional(row, next())?,
        bus_v: row.get_float(next())?,
        bus_a: row.get_float(next())?,
        torque_nm: row.get_float(next())?,
    })
}

fn optional(row: &parquet::record::Row, place: usize) -> Result<Option<f32>, ParquetError> {
    if row.is_null(place)? {
        return Ok(None);
    }
    row.get_float(place).map(Some)
}
