//! The image starts, speaks on its serial port, and runs the same each time. Run with `--release`.

use std::hash::Hasher;
use std::ops::Range;

use siskin_params::ParamId;

use crate::common::{Board, MS, Throttle, image};
use mavlink::dialects::ardupilotmega::{MavCmd, PARAM_REQUEST_READ_DATA, PARAM_VALUE_DATA};
use mavlink::{MAVLinkV2MessageRaw, MavHeader};
use siskin_emulator::link::LinkId;
use siskin_emulator::machine::Machine as _;
use siskin_vboard::processor::Access;

/// 115200 baud as divided from 170 MHz: bytes of eight data bits, start and stop.
const BYTE_NS: u64 = 10 * 1_000_000_000 / 115_200;

#[test]
fn it_starts_and_answers() {
    let mut board = Board::new(&image(), &[]);
    board.run(2_300 * MS);
    let beats = board.heard.heartbeats();
    println!(
        "heartbeats at {beats:?} ns, texts {:?}",
        board.heard.texts()
    );
    assert!(beats.len() >= 2, "{beats:?}");
    for two in beats.windows(2) {
        assert!((two[1] - two[0]).abs_diff(1000 * MS) < 20 * MS, "{beats:?}");
    }
    let texts = board.heard.texts();
    let greets = |text: &String| text.starts_with("Siskin ESC ") && text.ends_with("b-g431b-esc1");
    assert!(texts.len() == 1 && texts.iter().all(greets), "{texts:?}");
    // The time of a 20-byte frame on the line, and a few ms of telemetry before it.
    let (value, took_ns) = board.param("LIM_PHASE_A", 100 * MS).expect("an answer");
    println!("parameter after {took_ns} ns");
    assert_eq!(value, 20.0);
    assert!(took_ns > 20 * BYTE_NS * 2);
    let bridge = board.world().bridge();
    assert_eq!((bridge.violations(), bridge.is_off()), (0, true));
    let figures = board.board.figures().expect("the control runs");
    // 24 kHz, except during the start.
    assert!((50_000..=55_200).contains(&figures.interrupts), "{figures}");
}

/// The board's link passes on whole frames. One held back by the start of another, which never comes, is
/// passed on after 0.1 s of silence.
#[test]
fn a_question_behind_a_start_without_its_frame_is_answered_though_nothing_more_is_sent() {
    let mut board = Board::new(&image(), &[]);
    board.run(1_100 * MS);
    let mut question = MAVLinkV2MessageRaw::new();
    let data = PARAM_REQUEST_READ_DATA {
        param_index: -1,
        target_system: board.heard.from.system,
        target_component: board.heard.from.component,
        param_id: "PWM_FREQ_HZ".into(),
    };
    question.serialize_message_data(MavHeader::default(), &data);
    let bytes = [&[0xfd, 255, 0, 0, 0, 1, 1, 0, 0, 0], question.raw_bytes()].concat();
    let link = LinkId::default();
    board.board.receive(link, &bytes, &mut board.heard);
    board.run(90 * MS);
    assert!(board.heard.messages::<PARAM_VALUE_DATA>().is_empty());
    board.run(60 * MS);
    assert_eq!(board.heard.messages::<PARAM_VALUE_DATA>().len(), 1);
}

/// The board's least dead time is its default, also after a reset to the defaults, and nothing shorter is
/// accepted.
#[test]
fn a_dead_time_below_the_boards_is_refused() {
    let id = "PWM_DEADTIME_NS";
    let mut board = Board::new(&image(), &[]);
    board.run(30 * MS);
    assert_eq!(board.param(id, 100 * MS).expect("an answer").0, 750.0);
    assert!(board.heard.texts().is_empty(), "{:?}", board.heard.texts());
    board.set_param(id, 500.0);
    board.hear("below this board's 750 ns", 100 * MS);
    assert_eq!(board.param(id, 100 * MS).expect("an answer").0, 750.0);
    board.set_param(id, 1_000.0);
    board.run(10 * MS);
    assert_eq!(board.param(id, 100 * MS).expect("an answer").0, 1_000.0);
    board.command(MavCmd::MAV_CMD_PREFLIGHT_STORAGE, 2.0);
    board.run(1_500 * MS);
    assert_eq!(board.param(id, 100 * MS).expect("an answer").0, 750.0);
}

/// A shorter one stored by an earlier image is raised, which is reported.
#[test]
fn a_stored_dead_time_below_the_boards_is_raised() {
    let mut board = Board::new(&image(), &[(ParamId::PwmDeadtimeNs, 300.0)]);
    board.hear("PWM_DEADTIME_NS: below this board's 750 ns", 500 * MS);
    let (value, _) = board.param("PWM_DEADTIME_NS", 100 * MS).expect("an answer");
    assert_eq!(value, 750.0);
}

/// Runs with the motor and MAVLink; returns what came of it.
fn run() -> (u64, u64, u64) {
    let mut board = Board::turning(&image());
    board.param("MOT_KV", 100 * MS).expect("an answer");
    board.throttle = Throttle::Dshot(700);
    board.run(100 * MS);
    let instructions = board.board.processor().instructions();
    (
        instructions,
        board.world().bridge().edges(),
        board.heard.hash.finish(),
    )
}

#[test]
fn equal_inputs_give_equal_bits() {
    let first = run();
    println!("instructions, edges, hash: {first:?}");
    assert!(first.0 > 10_000_000 && first.1 > 10_000, "{first:?}");
    assert_eq!(first, run());
}

/// The chip's memories, each a separate one: SRAM1, SRAM2 and the CCM SRAM (RM0440, 2.2.2).
const RAMS: [Range<u32>; 3] = [
    0x2000_0000..0x2000_4000,
    0x2000_4000..0x2000_5800,
    0x1000_0000..0x1000_2800,
];

/// ES0431: the first write to a memory after a reset may be lost, unless it has been read.
#[test]
fn no_memory_is_written_before_it_is_read() {
    let mut board = Board::new(&image(), &[]);
    board.board.processor().watch(&RAMS);
    board.run(2 * MS);
    let first = board.board.processor().first_accesses();
    assert_eq!(first, [Some(Access::Read); 3]);
}
