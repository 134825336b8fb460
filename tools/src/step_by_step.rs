//! Commands that an ESC acknowledges step by step until they have ended.

use std::time::{Duration, Instant};

use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd, MavResult};

use crate::error::Error;
use crate::message::Message;
use crate::progress::Progress;
use crate::session::{ATTEMPTS, Session};

/// How long to wait for an acknowledgement before asking the ESC how far it is.
const STEP_TIMEOUT: Duration = Duration::from_millis(800);

/// How long to wait for the texts that say why it has failed.
const REASON_TIMEOUT: Duration = Duration::from_millis(200);

/// The longest that any of them may be under way: an identification takes 5 to 15 s, and several times that on an
/// emulator that does not keep up.
pub(crate) const LONGEST: Duration = Duration::from_secs(180);

/// What an ESC is to do.
pub(crate) struct Task {
    /// Its name for a person.
    pub(crate) what: &'static str,
    pub(crate) command: MavCmd,
    pub(crate) param1: f32,
    /// Parameter 1 of the same command that ends it; `None` if it ends by itself within a second.
    pub(crate) end: Option<f32>,
    /// How the ESC's texts about its failure begin.
    pub(crate) failures: &'static [&'static str],
    /// How its texts about each step begin.
    pub(crate) steps: Option<&'static str>,
}

/// Has the ESC do this; returns the result, and the texts that say why it failed. What a signal or silence breaks off
/// is ended in the ESC too.
///
/// # Errors
/// [`Error::Interrupted`] after a signal, [`Error::NoAnswer`] if the ESC falls silent, [`Error::Refused`] if it never
/// ends.
pub(crate) fn run(
    session: &mut Session,
    task: &Task,
    progress: &mut Progress,
) -> Result<(MavResult, Vec<String>), Error> {
    session.watch_interrupt()?;
    session.forget_texts();
    let result = follow(session, task, progress);
    or_end(
        session,
        task,
        result.map(|result| (result, session.texts(task.failures))),
    )
}

/// Passes on a result; what an error leaves under way is ended in the ESC, as far as it still hears.
///
/// # Errors
/// The result's, with what has become of the task.
pub(crate) fn or_end<T>(
    session: &mut Session,
    task: &Task,
    result: Result<T, Error>,
) -> Result<T, Error> {
    match result {
        Err(Error::Interrupted { signal, .. }) => Err(Error::Interrupted {
            what: task.what.into(),
            ended: match end(session, task) {
                Ok(()) if task.end.is_some() => "the ESC has ended it",
                Ok(()) => "the ESC ends it by itself within a second",
                Err(_) => "the ESC does not answer, and may go on: throttle or power-off ends it",
            },
            signal,
        }),
        Err(error @ Error::NoAnswer { .. }) => {
            // It may still hear what it does not answer.
            let _ = end(session, task);
            Err(error)
        }
        other => other,
    }
}

/// Begins it, and returns its result.
fn follow(session: &mut Session, task: &Task, progress: &mut Progress) -> Result<MavResult, Error> {
    let target = session.target();
    let latest = Instant::now() + LONGEST;
    let mut silent = 0;
    let mut confirmation = 0;
    while silent < ATTEMPTS {
        session.send(&COMMAND_LONG_DATA {
            command: task.command,
            param1: task.param1,
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
                Message::CommandAck(ack) if ack.command == task.command => {
                    silent = 0;
                    deadline = Instant::now() + STEP_TIMEOUT;
                    match ack.result {
                        MavResult::MAV_RESULT_IN_PROGRESS => progress.done(ack.percent),
                        MavResult::MAV_RESULT_FAILED => {
                            ended = Some(ack.result);
                            deadline = Instant::now() + REASON_TIMEOUT;
                        }
                        result => return Ok(result),
                    }
                }
                Message::StatusText(status) => {
                    let step = task.steps.and_then(|of| status.text.strip_prefix(of));
                    if let Some(step) = step {
                        progress.step(step);
                    }
                }
                _ => {}
            }
            if ended.is_none() && Instant::now() > latest {
                let _ = end(session, task);
                return Err(Error::Refused {
                    what: task.what.into(),
                    reason: format!("not over after {} s; try again", LONGEST.as_secs()),
                });
            }
        }
        if let Some(result) = ended {
            return Ok(result);
        }
    }
    Err(Error::NoAnswer {
        what: task.what.into(),
        attempts: ATTEMPTS,
    })
}

/// Has the ESC end it, if it is still under way.
///
/// # Errors
/// [`Error::NoAnswer`] if the ESC is silent.
pub(crate) fn end(session: &mut Session, task: &Task) -> Result<(), Error> {
    let Some(param1) = task.end else {
        return Ok(());
    };
    let target = session.target();
    session.ask(
        task.what,
        || COMMAND_LONG_DATA {
            command: task.command,
            param1,
            target_system: target.system,
            target_component: target.component,
            ..COMMAND_LONG_DATA::DEFAULT
        },
        |message| match message {
            // What was begun is acknowledged as failed, and its end as accepted.
            Message::CommandAck(ack) if ack.command == task.command => {
                (ack.result != MavResult::MAV_RESULT_IN_PROGRESS).then_some(())
            }
            _ => None,
        },
    )
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
        MavResult::MAV_RESULT_DENIED => {
            "denied; an ESC that has a signing key needs --sign-key FILE"
        }
        _ => "ended by the ESC",
    }
}
