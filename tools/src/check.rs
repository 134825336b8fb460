//! `siskin check`: has the ESC test itself, and prints the results.

use std::io::Write;

use mavlink::dialects::ardupilotmega::{MavCmd, MavResult};
use serde_json::{Value, json};

use crate::error::Error;
use crate::progress::Progress;
use crate::session::Session;
use crate::step_by_step::{self, Task};
use crate::{ftp, json};

/// The self-test, which takes most of a second.
const TASK: Task = Task {
    what: "self-test",
    command: MavCmd::MAV_CMD_RUN_PREARM_CHECKS,
    param1: 0.0,
    end: None,
    failures: &["Fault: "],
    steps: None,
};

/// Where the ESC serves its results.
const REPORT: &str = "@SYS/check.txt";

/// A line of the report.
#[derive(Debug, PartialEq)]
struct Item {
    name: String,
    /// `None` if a sensor gives no value.
    value: Option<f32>,
    unit: String,
    low: f32,
    high: f32,
    ok: bool,
}

/// Runs the self-test and prints its lines.
///
/// # Errors
/// [`Error::Refused`] if the ESC cannot test itself now, [`Error::Partly`] if an item has failed.
pub(crate) fn run(session: &mut Session, as_json: bool, out: &mut dyn Write) -> Result<(), Error> {
    let (result, texts) = {
        let mut progress = Progress::new(TASK.what);
        step_by_step::run(session, &TASK, &mut progress)?
    };
    let passed = match result {
        MavResult::MAV_RESULT_ACCEPTED => true,
        MavResult::MAV_RESULT_FAILED => false,
        other => {
            return Err(Error::Refused {
                what: TASK.what.into(),
                reason: step_by_step::why(other).into(),
            });
        }
    };
    let report = ftp::read_text(session, REPORT)?;
    let items = report.lines().map(Item::parse);
    let items = items.collect::<Option<Vec<_>>>().ok_or(Error::Refused {
        what: REPORT.into(),
        reason: "cannot be parsed; use the siskin program of the image's version".into(),
    })?;
    if passed && items.is_empty() {
        return Err(Error::Refused {
            what: TASK.what.into(),
            reason: "the ESC says that it passed, but lists nothing; try again".into(),
        });
    }
    if as_json {
        let items: Vec<_> = items.iter().map(Item::json).collect();
        writeln!(out, "{}", json!({ "items": items }))?;
    } else {
        for item in &items {
            writeln!(out, "{}", item.line())?;
        }
    }
    let wrong: Vec<_> = items.iter().filter(|item| !item.ok).collect();
    if passed && wrong.is_empty() {
        return Ok(());
    }
    let mut summary = if wrong.is_empty() {
        "self-test: not completed; is the throttle at zero, and the shaft at rest?".to_owned()
    } else {
        let names: Vec<_> = wrong.iter().map(|item| item.name.as_str()).collect();
        format!("self-test: {} out of bounds", names.join(", "))
    };
    for text in texts {
        summary += &format!(" ({text})");
    }
    Err(Error::Partly(summary))
}

impl Item {
    /// Parses a line: name, value, unit, bounds, verdict.
    fn parse(line: &str) -> Option<Self> {
        let mut words = line.split(' ');
        let name = words.next()?.to_owned();
        let value = match words.next()? {
            "-" => None,
            value => Some(value.parse().ok()?),
        };
        let unit = words.next()?.to_owned();
        let mut bound = || words.next()?.parse().ok();
        let (low, high) = (bound()?, bound()?);
        let ok = match words.next()? {
            "ok" => true,
            "FAILED" => false,
            _ => return None,
        };
        Some(Self {
            name,
            value,
            unit,
            low,
            high,
            ok,
        })
    }

    fn json(&self) -> Value {
        json!({
            "name": self.name,
            "value": self.value.map_or(Value::Null, json::number),
            "unit": self.unit,
            "low": json::number(self.low),
            "high": json::number(self.high),
            "ok": self.ok,
        })
    }

    fn line(&self) -> String {
        let value = self
            .value
            .map_or_else(|| "-".to_owned(), |value| json::fixed(value, 3));
        let verdict = if self.ok { "ok" } else { "FAILED" };
        format!(
            "{:<13} {value:>10} {:<4} {:>9.3} to {:>9.3}  {verdict}",
            self.name, self.unit, self.low, self.high
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_read_as_the_esc_writes_it() {
        let item = Item::parse("zero_b -0.125 A -4.000 4.000 ok").expect("a line");
        assert_eq!(item.name, "zero_b");
        assert_eq!((item.value, item.low, item.high), (Some(-0.125), -4.0, 4.0));
        assert!(item.ok);
        let item = Item::parse("temperature - degC -20.000 100.000 FAILED").expect("a line");
        assert_eq!(item.json()["value"], Value::Null);
        assert!(!item.ok);
        for line in ["", "zero_b", "zero_b x A 0 1 ok", "zero_b 0 A 0 1 fine"] {
            assert_eq!(Item::parse(line), None, "{line}");
        }
    }
}
