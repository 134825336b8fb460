//! A recording, reduced to the columns of a picture.

use std::fs::File;
use std::path::Path;

use siskin_control::drive::Phase;
use siskin_control::record::Recorded;

use super::error::PlotError;
use super::reduce::Trace;
use crate::record::{Row, trip};

/// A recording as shown in a picture.
#[derive(Clone, Debug)]
pub(super) struct Recording {
    /// The file's name.
    pub(super) name: String,
    /// Number of control periods.
    pub(super) periods: u64,
    /// Start of the first period, s.
    pub(super) t0_s: f64,
    /// End of the last period, s.
    pub(super) t1_s: f64,
    /// The drive's phase at the end of each column, if it has a period.
    pub(super) phases: Vec<Option<Phase>>,
    /// The faults set within each column, one bit each.
    pub(super) faults: Vec<u8>,
    pub(super) rpm: Trace,
    pub(super) rpm_est: Trace,
    pub(super) rpm_ref: Trace,
    pub(super) i_a_a: Trace,
    pub(super) i_d_a: Trace,
    pub(super) i_q_a: Trace,
    pub(super) u_d_v: Trace,
    pub(super) u_q_v: Trace,
    /// Greatest phase voltage of an undistorted sine, bus/√3.
    pub(super) u_max_v: Trace,
    /// Only while the observer leads: before that the estimate is meaningless.
    pub(super) angle_error_deg: Trace,
}

/// Latest time in a recording, s: 30 years, at which a double still resolves 0.1 µs.
const LATEST_S: f64 = 1e9;

/// The extent of a recording.
struct Extent {
    periods: u64,
    t0_s: f64,
    t1_s: f64,
}

impl Recording {
    /// Reads the recording at `path` into at most `columns` columns. It is read twice, first for
    /// its extent, so that its length does not matter.
    pub(super) fn read(path: &Path, columns: usize) -> Result<Self, PlotError> {
        let extent = extent(path)?;
        let count = columns.min(usize::try_from(extent.periods).unwrap_or(columns));
        let trace = Trace::new(count);
        let name = path.file_name().unwrap_or(path.as_os_str());
        let mut recording = Self {
            name: name.to_string_lossy().into_owned(),
            periods: extent.periods,
            t0_s: extent.t0_s,
            t1_s: extent.t1_s,
            phases: vec![None; count],
            faults: vec![0; count],
            rpm: trace.clone(),
            rpm_est: trace.clone(),
            rpm_ref: trace.clone(),
            i_a_a: trace.clone(),
            i_d_a: trace.clone(),
            i_q_a: trace.clone(),
            u_d_v: trace.clone(),
            u_q_v: trace.clone(),
            u_max_v: trace.clone(),
            angle_error_deg: trace,
        };
        for row in rows(path)? {
            recording.add(&row?.1);
        }
        Ok(recording)
    }

    fn add(&mut self, row: &Row) {
        let columns = self.phases.len();
        let share = (row.t_s - self.t0_s) / (self.t1_s - self.t0_s);
        // Half a period keeps rounding from moving a sample across the edge of its column.
        let middle = share + 0.5 / self.periods as f64;
        let column = ((middle * columns as f64) as usize).min(columns - 1);
        self.phases[column] = row.phase;
        self.faults[column] |= row.faults.unwrap_or_default();
        let leads = matches!(row.phase, Some(Phase::Run | Phase::Stopping));
        for (trace, value) in [
            (&mut self.rpm, Some(row.rpm)),
            (&mut self.rpm_ref, row.rpm_ref),
            (&mut self.i_a_a, Some(row.i_a_a)),
            (&mut self.i_d_a, row.i_d_a),
            (&mut self.i_q_a, row.i_q_a),
            (&mut self.u_d_v, row.u_d_v),
            (&mut self.u_q_v, row.u_q_v),
            (&mut self.u_max_v, Some(row.bus_v / 3.0_f32.sqrt())),
            (&mut self.rpm_est, row.rpm_est),
            (
                &mut self.angle_error_deg,
                row.angle_error_deg.filter(|_| leads),
            ),
        ] {
            if let Some(value) = value {
                trace.add(column, value);
            }
        }
    }

    /// Returns the middle of a column, s.
    pub(super) fn time_s(&self, column: usize) -> f64 {
        self.edge_s(column as f64 + 0.5)
    }

    /// Returns the time this many columns from the start, s.
    pub(super) fn edge_s(&self, columns: f64) -> f64 {
        self.t0_s + (self.t1_s - self.t0_s) * columns / self.phases.len() as f64
    }
}

/// The rows of a recording, each with its place in the file.
type Rows = Box<dyn Iterator<Item = Result<(String, Row), PlotError>>>;

/// Opens a recording in the format that its extension names; any other is read as CSV.
fn rows(path: &Path) -> Result<Rows, PlotError> {
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("parquet") => packed_rows(path),
        Some("bin") => rows_of_record(path),
        _ => text_rows(path),
    }
}

#[cfg(not(feature = "parquet"))]
fn packed_rows(path: &Path) -> Result<Rows, PlotError> {
    let reason = crate::record::NO_PARQUET.to_owned();
    Err(content(path, reason))
}

#[cfg(feature = "parquet")]
fn packed_rows(path: &Path) -> Result<Rows, PlotError> {
    use crate::record::parquet::{self, ReadError};

    let rows = parquet::read(path).map_err(|error| match error {
        ReadError::Io(source) => PlotError::Read {
            path: path.to_owned(),
            source,
        },
        ReadError::Content(reason) => content(path, reason),
    })?;
    let path = path.to_owned();
    Ok(Box::new(rows.enumerate().map(move |(index, row)| {
        let place = format!("row {}", index + 1);
        match row {
            Ok(row) => Ok((place, row)),
            Err(reason) => Err(content(&path, format!("{place}: {reason}"))),
        }
    })))
}

/// Reads the fault record of an ESC.
fn rows_of_record(path: &Path) -> Result<Rows, PlotError> {
    let bytes = std::fs::read(path).map_err(|source| PlotError::Read {
        path: path.to_owned(),
        source,
    })?;
    let recorded = Recorded::read(&bytes).ok_or_else(|| {
        content(
            path,
            "not a fault record; give the file of `siskin faults --save`".to_owned(),
        )
    })?;
    let rows = trip::rows(&recorded).into_iter().enumerate();
    Ok(Box::new(rows.map(|(index, row)| {
        Ok((format!("period {}", index + 1), row))
    })))
}

fn text_rows(path: &Path) -> Result<Rows, PlotError> {
    let file = File::open(path).map_err(|source| PlotError::Read {
        path: path.to_owned(),
        source,
    })?;
    let mut reader = csv::Reader::from_reader(file);
    let header = reader
        .byte_headers()
        .map_err(|error| not_a_recording(path, error))?;
    let missing = Row::COLUMNS
        .iter()
        .find(|name| header.iter().all(|cell| cell != name.as_bytes()));
    if let Some(name) = missing {
        let reason = format!("its first line names no column {name}");
        return Err(content(path, reason));
    }
    let path = path.to_owned();
    let mut rows = reader.into_deserialize();
    Ok(Box::new(std::iter::from_fn(move || {
        let line = rows.reader().position().line();
        let row = rows.next()?;
        let row = row.map_err(|error| not_a_recording(&path, error));
        Some(row.map(|row| (format!("line {line}"), row)))
    })))
}

fn extent(path: &Path) -> Result<Extent, PlotError> {
    let (mut periods, mut first, mut last) = (0, 0.0, f64::NEG_INFINITY);
    for row in rows(path)? {
        let (place, row) = row?;
        if row.t_s.is_nan() || row.t_s.abs() > LATEST_S {
            return Err(content(path, format!("{place}: t_s is not a time")));
        }
        if row.t_s <= last {
            return Err(content(path, format!("{place}: t_s does not rise")));
        }
        if periods == 0 {
            first = row.t_s;
        }
        last = row.t_s;
        periods += 1;
    }
    if periods < 2 {
        let reason = "it has fewer than two control periods";
        return Err(content(path, reason.to_owned()));
    }
    Ok(Extent {
        periods,
        t0_s: first,
        t1_s: last + (last - first) / (periods - 1) as f64,
    })
}

fn content(path: &Path, reason: String) -> PlotError {
    PlotError::Content {
        path: path.to_owned(),
        reason,
    }
}

/// Says what the file holds instead, in one line.
fn not_a_recording(path: &Path, error: csv::Error) -> PlotError {
    let path = path.to_owned();
    let line = error.position().map_or(0, csv::Position::line);
    let reason = match error.into_kind() {
        csv::ErrorKind::Io(source) => return PlotError::Read { path, source },
        csv::ErrorKind::UnequalLengths {
            expected_len, len, ..
        } => {
            format!("line {line}: {len} columns instead of {expected_len}")
        }
        csv::ErrorKind::Deserialize { err, .. } => {
            let column = err.field().map(|field| format!(", column {}", field + 1));
            format!("line {line}{}: {}", column.unwrap_or_default(), err.kind())
        }
        _ => format!("line {line} is not text"),
    };
    PlotError::Content { path, reason }
}
