//! Logic analyser exports, as level changes over time.

mod csv;
mod preamble;
mod vcd;

use std::io::BufRead;

use siskin_scope::printable;

use self::csv::Csv;
use self::vcd::Vcd;

/// A change of a channel's level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Change {
    /// When, on the capture's own clock: below 0 before a trigger.
    pub(crate) at_ns: i64,
    /// The channel's index in [`Capture::channels`].
    pub(crate) channel: usize,
    /// The level from then on.
    pub(crate) level: bool,
}

/// An export being read from beginning to end.
pub(crate) struct Capture<R> {
    format: Format<R>,
    levels: Vec<Option<bool>>,
}

enum Format<R> {
    Csv(Box<Csv<R>>),
    Vcd(Box<Vcd<R>>),
}

/// Why an export cannot be read, in one line: what is wrong, where, and what to do.
pub(crate) type Reason = String;

/// The latest time, 30 years: far from overflow in nanoseconds.
const LATEST_NS: u64 = 1_000_000_000_000_000_000;

/// Returns a line's time, unless it is before the one above or too late.
fn later(before_ns: Option<i64>, at_ns: i64, line: u64) -> Result<i64, Reason> {
    let wrong = if at_ns.unsigned_abs() > LATEST_NS {
        "beyond 30 years"
    } else if before_ns.is_some_and(|before_ns| at_ns < before_ns) {
        "before the one above"
    } else {
        return Ok(at_ns);
    };
    Err(format!(
        "line {line}: its time is {wrong}; export the capture again"
    ))
}

/// Most characters of a file that are shown.
const SHOWN: usize = 40;

/// Returns text from a file in a form that can be printed on one line.
fn shown(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    printable::line(&text.trim().chars().take(SHOWN).collect::<String>())
}

impl<R: BufRead> Capture<R> {
    /// Reads the export's head. Its content tells whether it is CSV or VCD.
    ///
    /// # Errors
    /// What the file is instead.
    pub(crate) fn open(mut input: R) -> Result<Self, Reason> {
        let start = input.fill_buf().map_err(|error| error.to_string())?;
        let start = start.trim_ascii_start();
        if start.starts_with(b"PK\x03\x04") || start.starts_with(b"<SALEAE>") {
            return Err("it is in an analyser's own format; export it as CSV or VCD".to_owned());
        }
        if start.contains(&0) {
            return Err("it is neither CSV nor VCD; export the capture as one of them".to_owned());
        }
        let format = if start.starts_with(b"$") {
            Format::Vcd(Box::new(Vcd::open(input)?))
        } else {
            Format::Csv(Box::new(Csv::open(input)?))
        };
        let mut capture = Self {
            format,
            levels: Vec::new(),
        };
        capture.levels = vec![None; capture.channels().len()];
        Ok(capture)
    }

    /// Returns the channels' names.
    pub(crate) fn channels(&self) -> &[String] {
        match &self.format {
            Format::Csv(csv) => csv.channels(),
            Format::Vcd(vcd) => vcd.channels(),
        }
    }

    /// Returns the analyser's sample rate, Hz, if the export states it.
    pub(crate) fn sample_hz(&self) -> Option<f64> {
        match &self.format {
            Format::Csv(csv) => csv.sample_hz(),
            Format::Vcd(_) => None,
        }
    }

    /// Returns the time up to which the export has been read, ns; its end once all of it has been read.
    pub(crate) fn now_ns(&self) -> i64 {
        match &self.format {
            Format::Csv(csv) => csv.now_ns(),
            Format::Vcd(vcd) => vcd.now_ns(),
        }
    }

    /// Returns the next change, `None` at the end. A channel's first level is not a change.
    ///
    /// # Errors
    /// The line that cannot be parsed.
    pub(crate) fn next(&mut self) -> Result<Option<Change>, Reason> {
        loop {
            let level = match &mut self.format {
                Format::Csv(csv) => csv.next(&self.levels)?,
                Format::Vcd(vcd) => vcd.next()?,
            };
            let Some(change) = level else {
                return Ok(None);
            };
            let before = self.levels[change.channel].replace(change.level);
            if before.is_some_and(|before| before != change.level) {
                return Ok(Some(change));
            }
        }
    }
}
