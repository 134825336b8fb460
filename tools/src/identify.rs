//! `siskin identify`: has the ESC identify its motor, and prints the results.

use std::io::Write;
use std::time::{Duration, Instant};

use mavlink::dialects::ardupilotmega::{MavCmd, MavResult};
use serde_json::{Value, json};
use siskin_params::ParamId;

use crate::error::Error;
use crate::message::Message;
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

/// The text of its success.
const DONE: &str = "Identification: done";

/// The longest from one step's text to the next, or to the last.
const NEXT_STEP: Duration = Duration::from_secs(10);

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
    let figures = measured(session)?;
    if !as_json {
        for figure in &figures {
            writeln!(out, "{}", figure.line())?;
        }
        out.flush()?;
    }
    let kept = if keep { self::keep(session) } else { Ok(()) };
    if as_json && !matches!(kept, Err(Error::Interrupted { .. })) {
        let is_kept = keep && kept.is_ok();
        let items: Vec<_> = figures.iter().map(|figure| figure.json(is_kept)).collect();
        writeln!(out, "{}", json!({ "items": items }))?;
    }
    kept
}

/// Has the motor identified.
fn measured(session: &mut Session) -> Result<Vec<Figure>, Error> {
    // Dropped, and so cleared from the terminal, before anything else is printed.
    let mut progress = Progress::new(TASK.what);
    let (result, texts) = step_by_step::run(session, &TASK, &mut progress)?;
    accepted(TASK.what, result, &texts)?;
    let result = reported(session, &mut progress);
    step_by_step::or_end(session, &TASK, result)
}

/// Returns the results. If there are none, the end of something else, as of the test at power-up, was acknowledged as
/// that of the identification, which goes on: then its texts say how it ends.
fn reported(session: &mut Session, progress: &mut Progress) -> Result<Vec<Figure>, Error> {
    let latest = Instant::now() + step_by_step::LONGEST;
    let mut deadline = Instant::now() + NEXT_STEP;
    let refused = |reason: String| Error::Refused {
        what: TASK.what.into(),
        reason,
    };
    loop {
        // What ended it may have been told before its end was acknowledged, or while the file was read.
        let was_done = !session.texts(&[DONE]).is_empty();
        let figures = report(session)?;
        if !figures.is_empty() {
            return Ok(figures);
        }
        let reasons = session.texts(TASK.failures);
        if !reasons.is_empty() {
            return Err(refused(reasons.join("; ")));
        }
        let told = if was_done {
            None
        } else {
            next_text(session, deadline.min(latest))?
        };
        let Some(text) = told else {
            step_by_step::end(session, &TASK)?;
            return Err(refused("it ended without a result; try again".into()));
        };
        if let Some(step) = TASK.steps.and_then(|of| text.strip_prefix(of)) {
            progress.step(step);
            deadline = Instant::now() + NEXT_STEP;
        }
    }
}

fn next_text(session: &mut Session, deadline: Instant) -> Result<Option<String>, Error> {
    while let Some(message) = session.next_of_target(deadline)? {
        if let Message::StatusText(status) = message {
            return Ok(Some(status.text));
        }
    }
    Ok(None)
}

fn report(session: &mut Session) -> Result<Vec<Figure>, Error> {
    let report = ftp::read_text(session, REPORT)?;
    let figures = report.lines().map(Figure::parse);
    figures.collect::<Option<Vec<_>>>().ok_or(Error::Refused {
        what: REPORT.into(),
        reason: "cannot be parsed; use the siskin program of the image's version".into(),
    })
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

    /// `kept` tells whether the parameters among the results have been stored.
    fn json(&self, kept: bool) -> Value {
        json!({
            "name": self.name,
            "value": json::number(self.value),
            "unit": self.unit,
            "confidence": json::number((1.0 - self.spread_percent / 100.0).max(0.0)),
            "kept": kept && ParamId::find(&self.name).is_some(),
        })
    }

    fn line(&self) -> String {
        let Self {
            name,
            value,
            unit,
            spread_percent,
        } = self;
        let value = json::fixed(*value, 3);
        format!("{name:<16} {value:>10} {unit:<7} within {spread_percent:.1} %")
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
        let json = |kept| figure.json(kept);
        assert_eq!(
            json(true),
            json!({
                "name": "MOT_R_MOHM", "value": 107.96, "unit": "mOhm", "confidence": 0.999, "kept": true,
            })
        );
        assert_eq!(json(false)["kept"], false);
        let other = Figure::parse("dead_time 500 ns 120 %").expect("a line");
        // It is no parameter, and its measurements do not agree.
        assert_eq!(
            (&other.json(true)["kept"], &other.json(true)["confidence"]),
            (&json!(false), &json!(0.0))
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
