//! Control periods that take longer than the PWM's: the bridge turns off, the turning motor is caught again, and the
//! tasks live on. Run with `--release`.

use siskin_control::drive::{Fault, Phase};
use siskin_control::record::Recorded;

use crate::common::{Board, MS, PWM_PERIOD, Throttle, US, image};

/// How many times as long as they should the periods take, so that each that drives the motor overruns.
const TOO_LONG: u64 = 10;

/// Likewise, so that each overruns, with the bridge off too.
const FAR_TOO_LONG: u64 = 20;

const BEGAN: &str = "Fault: control too slow";
const ENDED: &str = "Fault ended: control too slow";

/// A motor that has turned for long enough to be tried again.
fn flying() -> Board {
    let mut board = Board::turning(&image());
    board.run(600 * MS);
    board.heard.frames.clear();
    board
}

/// In the air: the throttle stays where it is.
#[test]
fn a_flight_goes_on_when_periods_have_overrun_for_a_while() {
    let mut board = flying();
    let before_rpm = board.rpm();
    board.world().slow_control(TOO_LONG);
    let took = board.until_off(MS);
    println!("off after {took} cycles");
    // Three periods of too many, each ten times a usual one, and the one that was on its way.
    assert!(took < 7 * PWM_PERIOD, "{took} cycles");
    board.run(10 * MS);
    board.world().slow_control(1);
    board.run(1_500 * MS);
    let texts = board.heard.texts();
    println!("{} rpm, {texts:?}", board.rpm());
    assert_eq!(texts, [BEGAN, ENDED]);
    assert!(
        (board.rpm() / before_rpm - 1.0).abs() < 0.02,
        "{before_rpm}"
    );
    assert!(!board.world().bridge().is_off());

    let recorded = Recorded::read(&board.file("@SYS/faults.bin")).expect("a record");
    let [seen] = &recorded.faults[..] else {
        panic!("{:?}", recorded.faults);
    };
    assert_eq!((seen.fault, seen.phase), (Fault::Overrun, Phase::Run));
    assert_eq!(seen.starts_ago, 0, "no reset");
    assert_eq!(recorded.holder, Some(1), "with the periods before it");
}

/// Runs for this long with a control that takes this many times as long as it should, or only while the bridge is on.
fn run_slowly(board: &mut Board, slowness: u64, only_on: bool, for_ms: u64) {
    for _ in 0..50 * for_ms {
        let fast = only_on && board.world().bridge().is_off();
        board.world().slow_control(if fast { 1 } else { slowness });
        board.run(20 * US);
    }
}

/// Makes the control slow for good in flight; asserts that the bridge ends off, while the tasks answer and nothing
/// restarts.
fn given_up(slowness: u64, only_on: bool) -> Board {
    let mut board = flying();
    run_slowly(&mut board, slowness, only_on, 1_500);
    let edges = board.world().bridge().edges();
    run_slowly(&mut board, slowness, only_on, 1_500);
    assert!(board.world().bridge().is_off());
    assert_eq!(board.world().bridge().edges(), edges);
    assert_eq!(board.world().bridge().violations(), 0);
    let texts = board.heard.texts();
    println!("{texts:?}");
    assert!(texts.iter().any(|text| text == BEGAN));
    assert!(!texts.iter().any(|text| text.starts_with("Restart")));
    assert!(board.param("LIM_PHASE_A", 500 * MS).is_some());
    board.world().slow_control(1);
    board
}

/// The pauses before the three retries are 20, 80 and 320 ms.
#[test]
fn a_drive_that_stays_too_slow_is_latched_with_the_bridge_off_after_three_retries() {
    let mut board = given_up(TOO_LONG, true);
    let recorded = Recorded::read(&board.file("@SYS/faults.bin")).expect("a record");
    assert_eq!(recorded.faults.len(), 4, "{:?}", recorded.faults);
    board.run(1_000 * MS);
    assert!(
        board.world().bridge().is_off(),
        "it waits for zero throttle"
    );
    board.throttle = Throttle::Dshot(0);
    board.hear(ENDED, 2_000 * MS);
    board.spin_up();
}

/// As long as periods overrun although the bridge is off, there is no retry.
#[test]
fn a_control_too_slow_even_with_the_bridge_off_leaves_the_tasks_their_time() {
    let mut board = given_up(FAR_TOO_LONG, false);
    let on = board.run_until(MS, 200 * MS, |board| !board.world().bridge().is_off());
    println!("on again after {on:?} ns");
    // The first pause, and some time until the rotor is known.
    assert!(on.is_some_and(|on_ns| on_ns >= 20 * MS), "{on:?}");
}
