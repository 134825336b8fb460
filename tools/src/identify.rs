//! `siskin identify`: has the ESC identify its motor, and prints the results.

use std::io::Write;
use std::time::{Duration, Instant};

use mavlink::dialects::ardupilotmega::{MavCmd, MavResult};
use serde_json::{Value, json};

use crate::error::Error;
use crate::progress::Progress;
use crate::session::Session;
use crate::step_by_step::{self, Task};
use crate::{ftp, json};

/// The identification. The dialect has no command of its own for it; parameter 1 says what to do.
const TASK: Task = Task {
    what: "identification",
    command: MavCmd::MAV_CMD_USER_1,
    param1: 1.0,
    end: Some(0.0),
    failures: &["Not identified: ", "Fault: "],
    steps: Some("Identification: "),
};

/// Has what was found kept.
const KEEP: Task = Task {
    what: "what was found",
    param1: 2.0,
    end: None,
    failures: &["Not kept: "],
    steps: None,
    ..TASK
};

/// Where the ESC serves its results.
const REPORT: &str = "@SYS/identify.txt";

/// How often, and how far apart, it is asked to keep the results, which it does once the shaft stands.
const KEEP_ATTEMPTS: u32 = 40;
const KEEP_PAUSE: Duration = Duration::from_millis(500);

/// A line of the report.
#[derive(Debug, PartialEq)]
struct Figure {
    name: String,
    value: f32,
    unit: String,
    spread_percent: f32,
}

/// Has the motor identified, prints the results, and has them kept if requested.
///
/// # Errors
/// [`Error::Refused`] with the ESC's reason.
pub(crate) fn run(
    session: &mut Session,
    (keep, as_json): (bool, bool),
    out: &mut dyn Write,
) -> Result<(), Error> {
    {
        // Dropped, and so cleared from the terminal, before anything else is printed.
        let mut progress = Progress::new(TASK.what);
        let (result, texts) = step_by_step::run(session, &TASK, &mut progress)?;
        accepted(TASK.what, result, &texts)?;
    }
    let report = String::from_utf8_lossy(&ftp::read(session, REPORT)?).into_owned();
    let figures = report.lines().map(Figure::parse);
    let figures = figures.collect::<Option<Vec<_>>>().ok_or(Error::Refused {
        what: REPORT.into(),
        reason: "cannot be parsed; use the siskin program of the image's version".into(),
    })?;
    if as_json {
        let figures: Vec<_> = figures.iter().map(Figure::json).collect();
        writeln!(out, "{}", json!({ "figures": figures }))?;
    } else {
        for figure in &figures {
            writeln!(out, "{}", figure.line())?;
        }
    }
    if keep {
        self::keep(session)?;
    }
    Ok(())
}

/// Has the results kept and stored, once the shaft stands.
fn keep(session: &mut Session) -> Result<(), Error> {
    let mut progress = Progress::new(KEEP.what);
    progress.step("waiting for the shaft to stand");
    for attempt in 1.. {
        let (result, texts) = step_by_step::run(session, &KEEP, &mut progress)?;
        if result == MavResult::MAV_RESULT_TEMPORARILY_REJECTED && attempt < KEEP_ATTEMPTS {
            let pause = Instant::now() + KEEP_PAUSE;
            while session.next_of_target(pause)?.is_some() {}
            continue;
        }
        return accepted(KEEP.what, result, &texts);
    }
    Ok(())
}

fn accepted(what: &str, result: MavResult, texts: &[String]) -> Result<(), Error> {
    let reason = match result {
        MavResult::MAV_RESULT_ACCEPTED => return Ok(()),
        MavResult::MAV_RESULT_FAILED if !texts.is_empty() => texts.join("; "),
        other => step_by_step::why(other).into(),
    };
    Err(Error::Refused {
        what: what.into(),
        reason,
    })
}

impl Figure {
    /// Parses a line: name, value, unit, spread.
    fn parse(line: &str) -> Option<Self> {
        let words: Vec<_> = line.split(' ').collect();
        let [name, value, unit, spread, "%"] = words[..] else {
            return None;
        };
        Some(Self {
            name: name.to_owned(),
            value: value.parse().ok()?,
            unit: unit.to_owned(),
            spread_percent: spread.parse().ok()?,
        })
    }

    fn json(&self) -> Value {
        json!({
            "name": self.name,
            "value": json::number(self.value),
            "unit": self.unit,
            "spread_percent": json::number(self.spread_percent),
        })
    }

    fn line(&self) -> String {
        let Self {
            name,
            value,
            unit,
            spread_percent,
        } = self;
        format!("{name:<16} {value:>10.3} {unit:<7} within {spread_percent:.1} %")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_read_as_the_esc_writes_it() {
        let figure = Figure::parse("MOT_R_MOHM 107.960 mOhm 0.100 %").expect("a line");
        assert_eq!((figure.value, figure.spread_percent), (107.96, 0.1));
        assert_eq!(
            figure.line(),
            "MOT_R_MOHM          107.960 mOhm    within 0.1 %"
        );
        for line in [
            "",
            "MOT_R_MOHM",
            "MOT_R_MOHM x mOhm 0.1 %",
            "MOT_R_MOHM 1 mOhm 0.1",
        ] {
            assert_eq!(Figure::parse(line), None, "{line}");
        }
    }
}
