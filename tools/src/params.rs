//! The parameter protocol: list, get, set, store.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, MavCmd, MavParamError, MavParamType, MavResult, MavSeverity,
    PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA,
};

use crate::error::Error;
use crate::message::{Message, StatusText, name_of, text};
use crate::session::{ANSWER_TIMEOUT, ATTEMPTS, Session};

/// Longest name that the protocol carries.
pub(crate) const NAME_LENGTH: usize = 16;

/// Missing parameters requested at once. Ten answers of 37 bytes take 65 ms at 57600 baud, well within the
/// answer timeout.
const BATCH: usize = 10;

/// The most parameters that an ESC is believed to have: ten times those of this version, and more than an autopilot.
const COUNT_MAX: u16 = 2048;

/// The longest that a list may take; at 57600 baud one takes two seconds.
const LIST_LONGEST: Duration = Duration::from_secs(120);

/// How long to wait for the reason once a refusal is known.
const REASON_TIMEOUT: Duration = Duration::from_millis(300);

/// A parameter's name and value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Param {
    pub(crate) name: String,
    pub(crate) value: f32,
}

/// What became of a value that was sent.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum SetOutcome {
    /// The ESC has it.
    Taken,
    /// The ESC refused, with its reason if it gave one.
    Refused(String),
}

/// Returns whether the protocol can carry this as a parameter name.
pub(crate) fn is_name(name: &str) -> bool {
    (1..=NAME_LENGTH).contains(&name.len()) && name.bytes().all(|b| b.is_ascii_graphic())
}

/// Returns every parameter in the ESC's order. Lost ones are requested again by index until the list is
/// complete.
///
/// # Errors
/// [`Error::NoAnswer`] if the ESC stays silent, [`Error::Refused`] if its list has no end.
pub(crate) fn list(session: &mut Session) -> Result<Vec<Param>, Error> {
    let latest = Instant::now() + LIST_LONGEST;
    let mut values = BTreeMap::new();
    let mut count = None;
    let mut silent_rounds = 0;
    loop {
        let missing: Vec<u16> = (0..count.unwrap_or(0))
            .filter(|i| !values.contains_key(i))
            .take(BATCH)
            .collect();
        if count.is_some() && missing.is_empty() {
            return Ok(values.into_values().collect());
        }
        if Instant::now() > latest {
            return Err(endless(
                session,
                format!("not complete after {} s", LIST_LONGEST.as_secs()),
            ));
        }
        if silent_rounds == ATTEMPTS {
            return Err(Error::NoAnswer {
                what: format!("parameter list of {}", name_of(session.target())),
                attempts: ATTEMPTS,
            });
        }
        let target = session.target();
        if missing.is_empty() {
            session.send(&PARAM_REQUEST_LIST_DATA {
                target_system: target.system,
                target_component: target.component,
            })?;
        }
        for &index in &missing {
            let Ok(param_index) = i16::try_from(index) else {
                continue;
            };
            session.send(&PARAM_REQUEST_READ_DATA {
                param_index,
                target_system: target.system,
                target_component: target.component,
                param_id: [0; NAME_LENGTH].into(),
            })?;
        }
        let before = values.len();
        let mut deadline = Instant::now() + ANSWER_TIMEOUT;
        while let Some(message) = session.next_of_target(deadline)? {
            let Message::ParamValue(value) = message else {
                continue;
            };
            // An answer to a set may carry 65535 instead of the index.
            if value.param_index >= value.param_count {
                continue;
            }
            if value.param_count > COUNT_MAX {
                return Err(endless(
                    session,
                    format!("claims to have {} parameters", value.param_count),
                ));
            }
            count = Some(value.param_count);
            let param = Param {
                name: text(&value.param_id),
                value: value.param_value,
            };
            if values.insert(value.param_index, param).is_none() {
                deadline = Instant::now() + ANSWER_TIMEOUT;
            }
            let still_missing = if missing.is_empty() {
                values.len() < usize::from(value.param_count)
            } else {
                missing.iter().any(|i| !values.contains_key(i))
            };
            if !still_missing {
                break;
            }
        }
        silent_rounds = if values.len() == before {
            silent_rounds + 1
        } else {
            0
        };
    }
}

fn endless(session: &Session, reason: String) -> Error {
    Error::Refused {
        what: format!("parameter list of {}", name_of(session.target())),
        reason: format!("{reason}; is this a Siskin ESC? Name another with --component"),
    }
}

/// Returns one parameter by name.
///
/// # Errors
/// [`Error::Refused`] if the ESC has no such parameter, [`Error::NoAnswer`] if it is silent.
pub(crate) fn get(session: &mut Session, name: &str) -> Result<f32, Error> {
    let target = session.target();
    let answer = session.ask(
        name,
        || PARAM_REQUEST_READ_DATA {
            param_index: -1,
            target_system: target.system,
            target_component: target.component,
            param_id: name.into(),
        },
        |message| match message {
            Message::ParamValue(value) if text(&value.param_id) == name => {
                Some(Ok(value.param_value))
            }
            Message::ParamError(error) if text(&error.param_id) == name => Some(Err(error.error)),
            _ => None,
        },
    )?;
    answer.map_err(|error| Error::Refused {
        what: name.into(),
        reason: words(error).into(),
    })
}

/// Sends a value and waits for what the ESC makes of it.
///
/// # Errors
/// [`Error::NoAnswer`] if the ESC is silent; a refusal is not an error here.
pub(crate) fn set(session: &mut Session, name: &str, value: f32) -> Result<SetOutcome, Error> {
    let target = session.target();
    let mut reasons = Reasons::default();
    let first = session.ask(
        name,
        || PARAM_SET_DATA {
            param_value: value,
            target_system: target.system,
            target_component: target.component,
            param_id: name.into(),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        },
        |message| reasons.hear(name, message),
    )?;
    if first == Some(value) {
        return Ok(SetOutcome::Taken);
    }
    // A different value may have been on its way when ours was sent, in a list that someone else requested;
    // and the reason for a refusal may follow it.
    let mut last = first;
    let deadline = Instant::now() + REASON_TIMEOUT;
    while let Some(message) = session.next_of_target(deadline)? {
        match reasons.hear(name, message) {
            Some(Some(now)) if now == value => return Ok(SetOutcome::Taken),
            Some(Some(now)) => last = Some(now),
            Some(None) | None => {}
        }
        if last.is_some() && reasons.text.is_some() {
            break;
        }
    }
    // Refused by an error whose value was lost on the way.
    if last.is_none() && reasons.error != Some(MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST) {
        last = Some(get(session, name)?);
    }
    let mut told = reasons.told(last);
    if session.lacks_key() {
        told += "; the ESC has a signing key, give --sign-key FILE";
    }
    Ok(SetOutcome::Refused(told))
}

/// What the ESC said about a value that was sent.
#[derive(Default)]
struct Reasons {
    error: Option<MavParamError>,
    /// A message that names the parameter, without the name if it begins with it.
    text: Option<String>,
}

impl Reasons {
    /// Takes a message; `Some` if it answers the set: with the parameter's current value, or with `None` if
    /// there is only an error.
    fn hear(&mut self, name: &str, message: Message) -> Option<Option<f32>> {
        match message {
            Message::ParamValue(value) if text(&value.param_id) == name => {
                Some(Some(value.param_value))
            }
            Message::ParamError(error) if text(&error.param_id) == name => {
                self.error = Some(error.error);
                Some(None)
            }
            Message::StatusText(status) => {
                let about = complaint(status).filter(|text| text.contains(name));
                let about = about.map(|text| without_name(&text, name).to_owned());
                self.text = about.or_else(|| self.text.take());
                None
            }
            _ => None,
        }
    }

    /// Returns the reason, in the ESC's own words if there are any.
    fn told(self, now: Option<f32>) -> String {
        let reason = self
            .text
            .unwrap_or_else(|| self.error.map_or("no reason given", words).to_owned());
        match now {
            Some(now) => format!("{reason}; it stays {now}"),
            None => reason,
        }
    }
}

/// Strips what the reader of the reason has just read: the name and that it was refused.
fn without_name<'a>(text: &'a str, name: &str) -> &'a str {
    text.strip_prefix(name)
        .and_then(|rest| rest.strip_prefix(" refused: "))
        .unwrap_or(text)
}

/// Returns the text of a message that reports a problem.
fn complaint(status: StatusText) -> Option<String> {
    (status.severity as u32 <= MavSeverity::MAV_SEVERITY_NOTICE as u32).then_some(status.text)
}

/// What the ESC is to do with its storage: parameter 1 of the command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Storage {
    /// Write the parameters.
    Write,
    /// Erase everything except the statistics, and return to the factory values.
    Reset,
}

/// Has the ESC do something with its storage, and waits until the result would survive a loss of power.
///
/// # Errors
/// [`Error::Refused`] with the ESC's reason, [`Error::NoAnswer`] if it is silent.
pub(crate) fn storage(session: &mut Session, what: Storage) -> Result<(), Error> {
    const COMMAND: MavCmd = MavCmd::MAV_CMD_PREFLIGHT_STORAGE;
    const BUSY: MavResult = MavResult::MAV_RESULT_TEMPORARILY_REJECTED;
    let target = session.target();
    let attempts = Cell::new(0);
    let busy = Cell::new(false);
    let mut reason = None;
    let (name, param1, failed) = match what {
        Storage::Write => (
            "storing",
            1.0,
            "failed; the values last only until power-off",
        ),
        Storage::Reset => ("the reset", 2.0, "failed"),
    };
    let answer = session.ask(
        name,
        || {
            attempts.set(attempts.get() + 1);
            COMMAND_LONG_DATA {
                param1,
                command: COMMAND,
                target_system: target.system,
                target_component: target.component,
                // Always marked as the first transmission: if that was lost, a higher number would look
                // like a repetition of the previous store, and be answered without storing.
                confirmation: 0,
                ..COMMAND_LONG_DATA::DEFAULT
            }
        },
        |message| match message {
            Message::CommandAck(ack) if ack.command == COMMAND => match ack.result {
                MavResult::MAV_RESULT_IN_PROGRESS => None,
                // Our own first attempt may be what keeps the ESC busy.
                BUSY if attempts.get() > 1 => {
                    busy.set(true);
                    None
                }
                result => Some(result),
            },
            Message::StatusText(status) => {
                reason = complaint(status);
                None
            }
            _ => None,
        },
    );
    let result = match answer {
        Err(Error::NoAnswer { .. }) if busy.get() => BUSY,
        other => other?,
    };
    if result == MavResult::MAV_RESULT_ACCEPTED {
        return Ok(());
    }
    // The reason may follow the answer.
    let deadline = Instant::now() + REASON_TIMEOUT;
    while let (None, Some(message)) = (&reason, session.next_of_target(deadline)?) {
        if let Message::StatusText(status) = message {
            reason = complaint(status);
        }
    }
    let why = match result {
        BUSY => "not now; stop the motor and try again",
        MavResult::MAV_RESULT_DENIED if session.lacks_key() => {
            "denied: it has a signing key; give --sign-key FILE"
        }
        MavResult::MAV_RESULT_DENIED => "denied",
        MavResult::MAV_RESULT_UNSUPPORTED => "this component stores nothing",
        _ => failed,
    };
    Err(Error::Refused {
        what: name.into(),
        reason: reason.map_or_else(|| why.into(), |reason| format!("{why} ({reason})")),
    })
}

fn words(error: MavParamError) -> &'static str {
    match error {
        MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST => {
            "no such parameter; 'siskin params list' shows all"
        }
        MavParamError::MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE => "out of range",
        MavParamError::MAV_PARAM_ERROR_PERMISSION_DENIED => "not permitted",
        MavParamError::MAV_PARAM_ERROR_READ_ONLY => "read-only",
        MavParamError::MAV_PARAM_ERROR_TYPE_UNSUPPORTED
        | MavParamError::MAV_PARAM_ERROR_TYPE_MISMATCH => "wrong type",
        MavParamError::MAV_PARAM_ERROR_READ_FAIL => "could not be read",
        _ => "refused",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_does_not_repeat_the_name() {
        for (text, reason) in [
            ("LIM_PHASE_A refused: out of range", "out of range"),
            (
                "CTL_RPM_MIN refused: CTL_RPM_MAX: too low",
                "CTL_RPM_MAX: too low",
            ),
            // From another firmware, or with a longer name.
            ("LIM_PHASE_A too high", "LIM_PHASE_A too high"),
            ("CTL_RPM_MINI refused: no", "CTL_RPM_MINI refused: no"),
        ] {
            let name = &text[..11];
            assert_eq!(without_name(text, name), reason);
        }
    }
}
