//! A recording, reduced to the columns of a picture.

use std::fs::File;
use std::path::Path;

use siskin_control::drive::Phase;

use super::PlotError;
use super::reduce::Trace;
use crate::record::Row;

/// A recording as a picture shows it.
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
    /// What the drive did at the end of each column, where there was a period.
    pub(super) phases: Vec<Option<Phase>>,
    /// The faults that were set within each column, one bit each.
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
    /// Only while the observer leads: before that the estimate means nothing.
    pub(super) angle_error_deg: Trace,
}

/// The extent of a recording.
struct Extent {
    periods: u64,
    t0_s: f64,
    t1_s: f64,
}

impl Recording {
    /// Reads the recording at `path` into at most `columns` columns. It is read twice, so that
    /// its length does not matter: first for its extent.
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
        for row in open(path)?.deserialize() {
            let row = row.map_err(|error| not_a_recording(path, error))?;
            recording.add(&row);
        }
        Ok(recording)
    }

    fn add(&mut self, row: &Row) {
        let columns = self.phases.len();
        let share = (row.t_s - self.t0_s) / (self.t1_s - self.t0_s);
        // A half of a period keeps rounding from moving a sample across the edge of its column.
        let middle = share + 0.5 / self.periods as f64;
        let column = ((middle * columns as f64) as usize).min(columns - 1);
        self.phases[column] = Some(row.phase);
        self.faults[column] |= row.faults;
        self.rpm.add(column, row.rpm);
        self.rpm_ref.add(column, row.rpm_ref);
        self.i_a_a.add(column, row.i_a_a);
        self.i_d_a.add(column, row.i_d_a);
        self.i_q_a.add(column, row.i_q_a);
        self.u_d_v.add(column, row.u_d_v);
        self.u_q_v.add(column, row.u_q_v);
        self.u_max_v.add(column, row.bus_v / 3.0_f32.sqrt());
        self.rpm_est.add(column, row.rpm_est);
        if matches!(row.phase, Phase::Run | Phase::Stopping) {
            self.angle_error_deg.add(column, row.angle_error_deg);
        }
    }

    /// The middle of a column, s.
    pub(super) fn time_s(&self, column: usize) -> f64 {
        self.edge_s(column as f64 + 0.5)
    }

    /// The time that is so many columns from the start, s.
    pub(super) fn edge_s(&self, columns: f64) -> f64 {
        self.t0_s + (self.t1_s - self.t0_s) * columns / self.phases.len() as f64
    }
}

fn open(path: &Path) -> Result<csv::Reader<File>, PlotError> {
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
    match missing {
        Some(name) => Err(PlotError::Content {
            path: path.to_owned(),
            reason: format!("its first line names no column {name}"),
        }),
        None => Ok(reader),
    }
}

fn extent(path: &Path) -> Result<Extent, PlotError> {
    let content = |reason: String| PlotError::Content {
        path: path.to_owned(),
        reason,
    };
    let mut reader = open(path)?;
    let header = reader
        .byte_headers()
        .map_err(|error| not_a_recording(path, error))?;
    let column = header
        .iter()
        .position(|name| name == b"t_s")
        .unwrap_or_default();
    let (mut periods, mut first, mut last) = (0, 0.0, f64::NEG_INFINITY);
    let mut record = csv::ByteRecord::new();
    while reader
        .read_byte_record(&mut record)
        .map_err(|error| not_a_recording(path, error))?
    {
        let line = record.position().map_or(0, csv::Position::line);
        let t_s = record
            .get(column)
            .and_then(|cell| std::str::from_utf8(cell).ok());
        let t_s = t_s.and_then(|cell| cell.parse::<f64>().ok());
        let Some(t_s) = t_s.filter(|t_s| t_s.is_finite()) else {
            return Err(content(format!("line {line}: t_s is not a time")));
        };
        if t_s <= last {
            return Err(content(format!("line {line}: t_s does not rise")));
        }
        if periods == 0 {
            first = t_s;
        }
        last = t_s;
        periods += 1;
    }
    if periods < 2 {
        return Err(content("it has fewer than two control periods".to_owned()));
    }
    Ok(Extent {
        periods,
        t0_s: first,
        t1_s: last + (last - first) / (periods - 1) as f64,
    })
}

/// What the file holds instead, in one line.
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
