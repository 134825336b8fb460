//! The whole program against an ESC that is broken, or means harm: it ends, with one line that says what is wrong.

mod fake;
#[path = "../common/run.rs"]
mod run;

use std::time::{Duration, Instant};

use fake::{Answer, Fake, Out, ack, command, file, push, text};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    MavCmd, MavResult, PARAM_REQUEST_LIST_DATA, PARAM_VALUE_DATA,
};
use run::{Run, siskin};

const IDENTIFY: MavCmd = MavCmd::MAV_CMD_USER_1;
const CHECK: MavCmd = MavCmd::MAV_CMD_RUN_PREARM_CHECKS;
const ACCEPTED: MavResult = MavResult::MAV_RESULT_ACCEPTED;

/// The longest that any of these takes on a busy machine.
const LONGEST: Duration = Duration::from_secs(40);

/// Runs `siskin` against it; asserts that it fails with one line that has these words.
#[track_caller]
fn refused(fake: &Fake, arguments: &[&str], words: &[&str]) -> Run {
    let begun = Instant::now();
    let run = siskin(&[&["--connect", &fake.endpoint], arguments].concat());
    assert!(begun.elapsed() < LONGEST, "{:?}", begun.elapsed());
    assert_eq!((run.status, run.err.lines().count()), (1, 1), "{run:?}");
    for word in words {
        assert!(run.err.contains(word), "{word}: {run:?}");
    }
    run
}

/// Acknowledges every command with this result, and serves a file.
fn answers(result: MavResult, piece: impl Fn(usize) -> Vec<u8> + Send + 'static) -> Answer {
    Box::new(move |frame, out| {
        if let Some((command, _)) = command(frame) {
            ack(out, command, result);
        }
        file(frame, out, &piece);
    })
}

#[test]
fn a_file_without_end_is_given_up() {
    for piece in [239, 1] {
        let endless = answers(ACCEPTED, move |_| vec![b'x'; piece]);
        let fake = Fake::start(endless, None);
        refused(
            &fake,
            &["check"],
            &["@SYS/check.txt: no end after", "--component"],
        );
    }
}

#[test]
fn a_list_of_too_many_parameters_is_given_up() {
    let claims: Answer = Box::new(|frame, out| {
        if frame.id == PARAM_REQUEST_LIST_DATA::ID {
            let value = PARAM_VALUE_DATA {
                param_count: 65_535,
                param_id: "A".into(),
                ..PARAM_VALUE_DATA::DEFAULT
            };
            push(out, &value);
        }
    });
    let fake = Fake::start(claims, None);
    let words = ["claims to have 65535 parameters", "--component"];
    let run = refused(&fake, &["params", "list"], &words);
    assert_eq!(run.out, "");
}

#[test]
fn a_success_without_a_result_is_none() {
    let nothing = |_| Vec::new();
    let fake = Fake::start(answers(ACCEPTED, nothing), None);
    refused(&fake, &["check"], &["self-test: ", "lists nothing"]);
    let fake = Fake::start(answers(ACCEPTED, nothing), None);
    let words = ["identification: it ended without a result", "try again"];
    refused(&fake, &["identify", "--keep"], &words);
}

#[test]
fn a_report_that_is_none_does_not_reach_the_terminal() {
    let report = b"\x1b[2Jx 1 A 0 2 ok\n";
    let piece = |at: usize| report.get(at..).unwrap_or_default().to_vec();
    let fake = Fake::start(answers(ACCEPTED, piece), None);
    let run = siskin(&["--connect", &fake.endpoint, "check"]);
    assert!(run.status == 0 && run.out.starts_with("?[2Jx"), "{run:?}");
}

#[test]
fn why_it_was_not_identified_is_told_though_the_test_at_power_up_ended_first() {
    // Acknowledged when that test ends: the identification goes on, and ends with a text.
    let early: Answer = Box::new(|frame, out| {
        match command(frame) {
            Some((IDENTIFY, 1.0)) => ack(out, IDENTIFY, ACCEPTED),
            Some((IDENTIFY, 2.0)) => {
                text(out, "Not kept: nothing is identified");
                ack(out, IDENTIFY, MavResult::MAV_RESULT_FAILED);
            }
            _ => {}
        }
        file(frame, out, |_| Vec::new());
    });
    let mut later = Out::new();
    text(&mut later, "Not identified: the rotor does not turn");
    let fake = Fake::start(early, Some((Duration::from_millis(700), later)));
    let words = ["identification: Not identified: the rotor does not turn"];
    refused(&fake, &["identify", "--keep"], &words);
    // Whether it comes before or after the file.
    let early: Answer = Box::new(|frame, out| {
        if let Some((command, _)) = command(frame) {
            text(out, "Not identified: a fault");
            ack(out, command, ACCEPTED);
        }
        file(frame, out, |_| Vec::new());
    });
    let fake = Fake::start(early, None);
    refused(
        &fake,
        &["identify"],
        &["identification: Not identified: a fault"],
    );
}

#[test]
fn a_self_test_that_fails_without_a_list_says_so() {
    let fake = Fake::start(answers(MavResult::MAV_RESULT_FAILED, |_| Vec::new()), None);
    refused(&fake, &["check"], &["self-test: not completed"]);
    let never: Answer = Box::new(|frame, out| {
        if command(frame).is_some_and(|(command, _)| command == CHECK) {
            ack(out, CHECK, MavResult::MAV_RESULT_UNSUPPORTED);
        }
    });
    refused(
        &Fake::start(never, None),
        &["check"],
        &["this component has none"],
    );
}
