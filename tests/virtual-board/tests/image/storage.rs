//! What is stored survives a loss of power and a reset at any moment of a save. Run with `--release`.

use crate::common::{Board, MS, US, image};
use mavlink::dialects::ardupilotmega::MavCmd;
use siskin_vboard::chip::Cause;
use siskin_vboard::processor::Surroundings;
use siskin_vboard::time::{Cycles, ns};

/// The parameter that is changed, and its default.
const PARAM: &str = "LIM_PHASE_A";
const DEFAULT: f32 = 20.0;

/// `MAV_CMD_PREFLIGHT_STORAGE`: save, and back to the defaults.
const SAVE: f32 = 1.0;
const FORGET: f32 = 2.0;

/// Cuts within each programming and each erase.
const CUTS: u64 = 3;

/// Requests something of the store until it begins, which is not while a start still plays its tones;
/// returns until when the flash is busy with the first operation.
fn store(board: &mut Board, what: f32) -> Cycles {
    for _ in 0..60 {
        board.command(MavCmd::MAV_CMD_PREFLIGHT_STORAGE, what);
        let after = board.now();
        if let Some(ends) = next_work(board, after, 30 * MS) {
            return ends;
        }
    }
    panic!("nothing is stored: {:?}", board.heard.texts());
}

/// Runs until the flash begins an operation; returns until when it is busy.
fn next_work(board: &mut Board, after: Cycles, within_ns: u64) -> Option<Cycles> {
    let mut ends = 0;
    let found = board.run_until(5 * US, within_ns, |board| {
        ends = Surroundings::flash_busy_until(board.world());
        ends > after
    });
    found.map(|_| ends)
}

fn value(board: &mut Board) -> f32 {
    let answer = board.param(PARAM, 400 * MS);
    let (value, _) = answer.expect("the ESC has started");
    let texts = board.heard.texts();
    let failed = texts.iter().any(|text| text.contains("Restart:"));
    assert!(!failed, "{texts:?}");
    value
}

/// SplitMix64, by Steele, Lea and Flood.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mixed = (*state ^ *state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ mixed >> 31
}

/// Interrupts a command to the store in each of its operations, and checks what is kept. Words torn by a
/// loss of power are reported by byte addresses, or by double words.
fn interrupt(cause: Cause, what: f32, by_words: bool) {
    let mut board = Board::new(&image(), &[]);
    board.world().flash().tell_torn_by_words(by_words);
    board.run(30 * MS);
    let mut seed = 1;
    let mut kept = DEFAULT;
    let mut wanted;
    let (mut cuts, mut taken) = (0, 0);
    for work in 0.. {
        let mut is_last = false;
        for _ in 0..CUTS {
            if what == FORGET {
                // There must be something to be erased.
                wanted = if kept == 15.0 { 12.0 } else { 15.0 };
                board.set_param(PARAM, wanted);
                store(&mut board, SAVE);
                board.run(150 * MS);
                (kept, wanted) = (wanted, DEFAULT);
            } else {
                wanted = if kept == 15.0 { 12.0 } else { 15.0 };
                board.set_param(PARAM, wanted);
                board.run(10 * MS);
            }
            let mut ends = store(&mut board, what);
            for _ in 0..work {
                let Some(next) = next_work(&mut board, ends, 60 * MS) else {
                    is_last = true;
                    break;
                };
                ends = next;
            }
            let left = ns(ends.saturating_sub(board.now()));
            if left > 0 {
                board.run(random(&mut seed) % left);
            }
            board.reset(cause);
            board.run(60 * MS);
            let found = value(&mut board);
            assert!(
                found == kept || found == wanted,
                "{found} after a cut in work {work}, where {kept} was to become {wanted}"
            );
            if is_last {
                assert_eq!(found, wanted, "it was done");
            }
            cuts += 1;
            taken += u32::from(found == wanted);
            kept = found;
        }
        if is_last {
            println!("{cause:?}: {cuts} cuts in {work} works, {taken} found the new value");
            assert!(work >= 2, "{work}");
            let told = board.world().flash().torn_removed();
            println!("the handler has been told of a torn word {told} times");
            assert!(cause != Cause::Power || told > 0);
            break;
        }
    }
}

#[test]
fn a_loss_of_power_in_a_save() {
    interrupt(Cause::Power, SAVE, false);
}

#[test]
fn a_loss_of_power_in_a_save_on_a_chip_that_counts_double_words() {
    interrupt(Cause::Power, SAVE, true);
}

#[test]
fn a_loss_of_power_in_an_erase() {
    interrupt(Cause::Power, FORGET, false);
}

#[test]
fn a_reset_in_a_save() {
    interrupt(Cause::Pin, SAVE, false);
}
