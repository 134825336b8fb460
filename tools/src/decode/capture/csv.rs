//! Comma-separated values, as written by Saleae Logic, sigrok-cli, PulseView and DSView.
//!
//! A row holds the level of each channel, usually after a time. Saleae's rows are changes; sigrok's are
//! samples, of which it omits repeated ones on request.

use std::io::BufRead;

use csv::{ByteRecord, Reader, ReaderBuilder};

use super::preamble::Preamble;
use super::{Change, Reason, later, shown};

/// When a row was sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Clock {
    /// The rows are successive samples.
    Rows { sample_ns: f64 },
    /// Sigrok's time column counts periods rounded down to a whole number of its unit, 41 instead of
    /// 41.67 ns at 24 MHz, so only their count can be trusted.
    Periods { period: f64, sample_ns: f64 },
    /// The time column is in this unit.
    Column { unit_ns: f64 },
}

/// A table being read.
pub(super) struct Csv<R> {
    rows: Reader<R>,
    row: ByteRecord,
    /// Rows before the current one, without the header.
    count: u64,
    /// Next channel in the current row; if past the last, the next row is to be read.
    channel: usize,
    clock: Clock,
    names: Vec<String>,
    sample_hz: Option<f64>,
    lines_before: u64,
    now_ns: Option<i64>,
}

impl<R: BufRead> Csv<R> {
    /// Reads up to the first row of levels.
    pub(super) fn open(mut input: R) -> Result<Self, Reason> {
        let preamble = Preamble::read(&mut input).map_err(|error| error.to_string())?;
        let mut rows = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(b';'))
            .from_reader(input);
        let mut row = ByteRecord::new();
        if !rows.read_byte_record(&mut row).map_err(reason)? {
            return Err("there is no table in it; give a CSV or VCD export".to_owned());
        }
        let header = Header::of(&row, &preamble)?;
        let clock = header.clock(preamble.sample_hz)?;
        let mut csv = Self {
            rows,
            row,
            count: 0,
            channel: header.names.len(),
            clock,
            names: header.names,
            sample_hz: preamble.sample_hz,
            lines_before: preamble.lines,
            now_ns: None,
        };
        if header.is_a_row {
            csv.begin_row()?;
        }
        Ok(csv)
    }

    pub(super) fn channels(&self) -> &[String] {
        &self.names
    }

    pub(super) fn sample_hz(&self) -> Option<f64> {
        self.sample_hz
    }

    pub(super) fn now_ns(&self) -> i64 {
        self.now_ns.unwrap_or(0)
    }

    /// Returns the next level that differs from the one in `levels`.
    pub(super) fn next(&mut self, levels: &[Option<bool>]) -> Result<Option<Change>, Reason> {
        loop {
            while self.channel < self.names.len() {
                let channel = self.channel;
                self.channel += 1;
                let level = self.level(channel)?;
                if level.is_some() && level != levels[channel] {
                    return Ok(level.map(|level| Change {
                        at_ns: self.now_ns(),
                        channel,
                        level,
                    }));
                }
            }
            if !self.rows.read_byte_record(&mut self.row).map_err(reason)? {
                return Ok(None);
            }
            self.begin_row()?;
        }
    }

    /// Starts on the row just read.
    fn begin_row(&mut self) -> Result<(), Reason> {
        self.now_ns = Some(later(self.now_ns, self.time_ns()?, self.line())?);
        self.count += 1;
        self.channel = 0;
        Ok(())
    }

    /// Returns the level in the current row; `None` if the analyser has none.
    fn level(&self, channel: usize) -> Result<Option<bool>, Reason> {
        let column = channel + usize::from(self.clock.has_column());
        match self.row.get(column).map(<[u8]>::trim_ascii) {
            Some(b"0") => Ok(Some(false)),
            Some(b"1") => Ok(Some(true)),
            Some(b"X" | b"x" | b"") => Ok(None),
            Some(other) => Err(format!(
                "line {}: '{}' is not a level (0 or 1); export digital channels",
                self.line(),
                shown(other)
            )),
            None => Err(format!(
                "line {}: {} columns are missing; export the capture again",
                self.line(),
                self.names.len() - channel
            )),
        }
    }

    /// Returns when the current row was sampled, saturating if it is too late for the type.
    fn time_ns(&self) -> Result<i64, Reason> {
        let time_ns = match self.clock {
            Clock::Rows { sample_ns } => self.count as f64 * sample_ns,
            Clock::Periods { period, sample_ns } => (self.time()? / period).round() * sample_ns,
            Clock::Column { unit_ns } => self.time()? * unit_ns,
        };
        Ok(time_ns.round() as i64)
    }

    fn time(&self) -> Result<f64, Reason> {
        let text = self.row.get(0).unwrap_or_default();
        number(&String::from_utf8_lossy(text)).ok_or_else(|| {
            format!(
                "line {}: '{}' is not a time; export numbers, not dates",
                self.line(),
                shown(text)
            )
        })
    }

    /// Returns the line of the current row.
    fn line(&self) -> u64 {
        self.lines_before + self.row.position().map_or(0, csv::Position::line)
    }
}

impl Clock {
    fn has_column(self) -> bool {
        !matches!(self, Self::Rows { .. })
    }
}

/// What the first row says about the columns.
struct Header {
    names: Vec<String>,
    time: TimeColumn,
    /// There is no header: the levels begin here.
    is_a_row: bool,
}

/// What the first column is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum TimeColumn {
    /// A channel.
    None,
    /// A time without a unit.
    Unitless,
    /// A time under sigrok's label for this unit.
    Sigrok(f64),
    /// A time in this unit.
    Unit(f64),
}

impl Header {
    fn of(row: &ByteRecord, preamble: &Preamble) -> Result<Self, Reason> {
        let fields: Vec<_> = row.iter().map(shown).collect();
        let told = &preamble.channels;
        if number(&fields[0]).is_some() {
            let time = match fields.len().checked_sub(told.len()) {
                Some(0) => TimeColumn::None,
                Some(1) if !told.is_empty() => TimeColumn::Unitless,
                _ => {
                    return Err("it has no header; export it with one".to_owned());
                }
            };
            return Ok(Self {
                names: told.clone(),
                time,
                is_a_row: true,
            });
        }
        let time = time_column(&fields[0]);
        let names = &fields[usize::from(time != TimeColumn::None)..];
        // Where sigrok does not write the names, it writes what a column holds: `logic` for each.
        let all_same = names.iter().all(|name| name == "logic");
        let names = if all_same && told.len() == names.len() {
            told.clone()
        } else {
            names.to_vec()
        };
        if names.is_empty() {
            return Err("its header names no channel; give a CSV or VCD export".to_owned());
        }
        Ok(Self {
            names,
            time,
            is_a_row: false,
        })
    }

    fn clock(&self, sample_hz: Option<f64>) -> Result<Clock, Reason> {
        let sample_ns = sample_hz.map(|hz| 1e9 / hz);
        Ok(match (self.time, sample_ns) {
            (TimeColumn::None, Some(sample_ns)) => Clock::Rows { sample_ns },
            (TimeColumn::None, None) => {
                return Err(
                    "it has neither a time column nor a sample rate; export it with one".to_owned(),
                );
            }
            (TimeColumn::Unitless | TimeColumn::Sigrok(_), Some(sample_ns)) => {
                // The coarsest decimal unit that fits into a period at least once.
                let hz = 1e9 / sample_ns;
                let mut units_per_s = 1.0;
                while units_per_s < hz {
                    units_per_s *= 1000.0;
                }
                Clock::Periods {
                    period: (units_per_s / hz).floor(),
                    sample_ns,
                }
            }
            (TimeColumn::Sigrok(unit_ns) | TimeColumn::Unit(unit_ns), _) => {
                Clock::Column { unit_ns }
            }
            (TimeColumn::Unitless, None) => Clock::Column { unit_ns: 1e9 },
        })
    }
}

/// Interprets a header's first field: `Time [s]`, `Time[s]`, `Time(s)`, `Time` or `nanoseconds`.
fn time_column(field: &str) -> TimeColumn {
    let field = field.to_ascii_lowercase();
    let sigrok = match field.as_str() {
        "milliseconds" => Some(1e6),
        "microseconds" => Some(1e3),
        "nanoseconds" => Some(1.0),
        "picoseconds" => Some(1e-3),
        "femtoseconds" => Some(1e-6),
        _ => None,
    };
    if let Some(unit_ns) = sigrok {
        return TimeColumn::Sigrok(unit_ns);
    }
    let Some(unit) = field.strip_prefix("time") else {
        return TimeColumn::None;
    };
    match unit.trim_matches([' ', '[', ']', '(', ')']) {
        "" => TimeColumn::Unitless,
        "s" => TimeColumn::Unit(1e9),
        "ms" => TimeColumn::Unit(1e6),
        "us" | "\u{b5}s" | "\u{3bc}s" => TimeColumn::Unit(1e3),
        "ns" => TimeColumn::Unit(1.0),
        _ => TimeColumn::None,
    }
}

fn number(text: &str) -> Option<f64> {
    let number = text.trim().parse::<f64>().ok()?;
    number.is_finite().then_some(number)
}

fn reason(error: csv::Error) -> Reason {
    error.to_string()
}
