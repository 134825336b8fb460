//! Commands that an ESC acknowledges step by step until they have ended.

use std::time::{Duration, Instant};

use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd, MavResult};

use crate::error::Error;
use crate::message::Message;
use crate::session::{ATTEMPTS, Session};

/// How long to wait for an acknowledgement before asking the ESC how far it is.
const STEP_TIMEOUT: Duration = Duration::from_millis(800);

/// How long to wait for the texts that say why it has failed.
const REASON_TIMEOUT: Duration = Duration::from_millis(200);

/// Has the ESC do this, called `what`; returns the result, and the texts with one of these beginnings received
/// meanwhile.
///
/// # Errors
/// [`Error::NoAnswer`] if the ESC falls silent.
pub(crate) fn run(
    session: &mut Session,
    what: &str,
    (command, param1): (MavCmd, f32),
    beginnings: &[&str],
) -> Result<(MavResult, Vec<String>), Error> {
    let target = session.target();
    let mut texts = Vec::new();
    let mut silent = 0;
    let mut confirmation = 0;
    while silent < ATTEMPTS {
        session.send(&COMMAND_LONG_DATA {
            command,
            param1,
            target_system: target.system,
            target_component: target.component,
            // Repetitions ask how far it is.
            confirmation,
            ..COMMAND_LONG_DATA::DEFAULT
        })?;
        silent += 1;
        confirmation = confirmation.saturating_add(1);
        let mut deadline = Instant::now() + STEP_TIMEOUT;
        let mut ended = None;
        while let Some(message) = session.next_of_target(deadline)? {
            match message {
                Message::CommandAck(ack) if ack.command == command => {
                    silent = 0;
                    deadline = Instant::now() + STEP_TIMEOUT;
                    match ack.result {
                        MavResult::MAV_RESULT_IN_PROGRESS => {}
                        MavResult::MAV_RESULT_FAILED => {
                            ended = Some(ack.result);
                            deadline = Instant::now() + REASON_TIMEOUT;
                        }
                        result => return Ok((result, texts)),
                    }
                }
                Message::StatusText(status)
                    if beginnings.iter().any(|of| status.text.starts_with(of)) =>
                {
                    texts.push(status.text);
                }
                _ => {}
            }
        }
        if let Some(result) = ended {
            return Ok((result, texts));
        }
    }
    Err(Error::NoAnswer {
        what: what.into(),
        attempts: ATTEMPTS,
    })
}

/// Returns why the ESC does not begin.
pub(crate) fn why(result: MavResult) -> &'static str {
    match result {
        MavResult::MAV_RESULT_TEMPORARILY_REJECTED => {
            "not now; it needs a shaft at rest, no fault, and the throttle at zero or unplugged"
        }
        MavResult::MAV_RESULT_UNSUPPORTED => {
            "this component has none: is its image older than this program?"
        }
        MavResult::MAV_RESULT_DENIED => "denied; is the link signed with a key?",
        _ => "ended by the ESC",
    }
}
