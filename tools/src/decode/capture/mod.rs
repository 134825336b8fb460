//! Exports of logic analysers as changes of level over time.

mod csv;
mod preamble;
mod vcd;

use std::io::BufRead;

use self::csv::Csv;
use self::vcd::Vcd;

/// A channel's level has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Change {
    /// When, on the capture's own clock: below 0 for what came before a trigger.
    pub(crate) at_ns: i64,
    /// The channel's place among [`Capture::channels`].
    pub(crate) channel: usize,
    /// The level from then on.
    pub(crate) level: bool,
}

/// An export that is being read, from its beginning to its end.
pub(crate) struct Capture<R> {
    format: Format<R>,
    levels: Vec<Option<bool>>,
}

enum Format<R> {
    Csv(Box<Csv<R>>),
    Vcd(Box<Vcd<R>>),
}

/// Why an export cannot be read, on one line: what is wrong, where, and what to do.
pub(crate) type Reason = String;

/// The latest time, 30 years: far from where nanoseconds overflow.
const LATEST_NS: u64 = 1_000_000_000_000_000_000;

/// The time of a line, unless it is before the one above or too late.
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

/// Characters of a file that are shown at most.
const SHOWN: usize = 40;

/// Text of a file as it can be shown on a line.
fn shown(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    let shown = |c: char| if c.is_control() { ' ' } else { c };
    text.trim().chars().take(SHOWN).map(shown).collect()
}

impl<R: BufRead> Capture<R> {
    /// Reads the export's head. Its content tells whether it is CSV or VCD.
    ///
    /// # Errors
    /// What it is instead.
    pub(crate) fn open(mut input: R) -> Result<Self, Reason> {
        let start = input.fill_buf().map_err(|error| error.to_string())?;
        let start = start.trim_ascii_start();
        if start.starts_with(b"PK\x03\x04") || start.starts_with(b"<SALEAE>") {
            return Err("it is an analyser's own format; export it as CSV or VCD".to_owned());
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

    /// The channels' names.
    pub(crate) fn channels(&self) -> &[String] {
        match &self.format {
            Format::Csv(csv) => csv.channels(),
            Format::Vcd(vcd) => vcd.channels(),
        }
    }

    /// The rate of the analyser, where the export tells it, Hz.
    pub(crate) fn sample_hz(&self) -> Option<f64> {
        match &self.format {
            Format::Csv(csv) => csv.sample_hz(),
            Format::Vcd(_) => None,
        }
    }

    /// Up to when the export has been read, ns; its end when it has been read whole.
    pub(crate) fn now_ns(&self) -> i64 {
        match &self.format {
            Format::Csv(csv) => csv.now_ns(),
            Format::Vcd(vcd) => vcd.now_ns(),
        }
    }

    /// The next change; nothing at the end. A channel's first level is none.
    ///
    /// # Errors
    /// The line that cannot be understood.
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
