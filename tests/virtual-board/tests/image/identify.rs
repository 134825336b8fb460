//! The image identifies its motor. Run with `--release`.

use mavlink::dialects::ardupilotmega::{COMMAND_ACK_DATA, MavCmd, MavResult};
use siskin_params::ParamId;
use siskin_vboard::chip::Cause;

use crate::common::{Board, MS, Throttle, image};

const IDENTIFY: MavCmd = MavCmd::MAV_CMD_USER_1;
const BEGIN: f32 = 1.0;
const KEEP: f32 = 2.0;

/// What is found, its value on the first paper's bench, and the bounds.
const FOUND: [(ParamId, f32, f32); 4] = [
    (ParamId::MotRMohm, 108.0, 0.03),
    (ParamId::MotLUh, 30.6, 0.05),
    (ParamId::MotFluxMwb, 1.3, 0.02),
    (ParamId::MotJGcm2, 1430.0, 0.1),
];

/// The longest that an identification may take.
const LONGEST: u64 = 20_000 * MS;

/// A board that knows no motor, armed at zero throttle by nobody.
fn unknown() -> Board {
    let nothing = FOUND.map(|(id, ..)| (id, 0.0));
    let mut board = Board::new(&image(), &nothing);
    board.throttle = Throttle::Dshot(0);
    board.run(1_500 * MS);
    board
}

/// Runs until a command has its last answer, and returns that.
fn result(board: &mut Board, what: f32) -> MavResult {
    board.heard.frames.clear();
    board.command(IDENTIFY, what);
    let mut last = None;
    board.run_until(20 * MS, LONGEST, |board| {
        let acks = board.heard.messages::<COMMAND_ACK_DATA>();
        last = acks.last().map(|(_, ack)| ack.result);
        !matches!(last, None | Some(MavResult::MAV_RESULT_IN_PROGRESS))
    });
    last.expect("it is answered")
}

/// Has the results kept, once the shaft stands.
fn keep(board: &mut Board) -> MavResult {
    for _ in 0..60 {
        let result = result(board, KEEP);
        if result != MavResult::MAV_RESULT_TEMPORARILY_REJECTED {
            return result;
        }
        board.run(500 * MS);
    }
    MavResult::MAV_RESULT_TEMPORARILY_REJECTED
}

fn is_found(board: &mut Board) {
    for (id, truth, share) in FOUND {
        let name = id.entry().name;
        let (value, _) = board.param(name, 1_000 * MS).expect("its value");
        assert!((value / truth - 1.0).abs() < share, "{name} {value}");
    }
}

#[test]
fn the_motor_is_found_and_kept_over_a_loss_of_power() {
    let mut board = unknown();
    let ended = result(&mut board, BEGIN);
    assert_eq!(
        ended,
        MavResult::MAV_RESULT_ACCEPTED,
        "{:?}",
        board.heard.texts()
    );
    assert_eq!(keep(&mut board), MavResult::MAV_RESULT_ACCEPTED);
    is_found(&mut board);
    board.run(2_500 * MS);
    board.reset(Cause::Power);
    board.run(1_500 * MS);
    is_found(&mut board);
    board.throttle = Throttle::Dshot(1_048);
    board.run(1_500 * MS);
    assert!(board.rpm() > 3_000.0, "{} rpm", board.rpm());
}
