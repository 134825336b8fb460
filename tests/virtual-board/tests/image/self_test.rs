//! The image tests its board: a sound one passes, and each defect is named. Run with `--release`.

use mavlink::dialects::ardupilotmega::{COMMAND_ACK_DATA, MavCmd, MavResult};
use siskin_emulator::fault::InForce;
use siskin_emulator::plant::Gate;
use siskin_params::ParamId;
use siskin_vboard::chip::comparator::Defect;
use siskin_vboard::time::ns;

use crate::common::{Board, MS, PWM_PERIOD, Scope, Throttle, image};

/// nBOOT0 and nSWBOOT0 in the option bytes.
const N_BOOT0: u32 = 1 << 27;
const N_SW_BOOT0: u32 = 1 << 26;

const PASSED: MavResult = MavResult::MAV_RESULT_ACCEPTED;
const FAILED: MavResult = MavResult::MAV_RESULT_FAILED;

/// Runs a self-test by command, at zero throttle, and returns its result.
fn check(board: &mut Board) -> MavResult {
    board.command(MavCmd::MAV_CMD_RUN_PREARM_CHECKS, 0.0);
    let answer = |board: &Board| {
        let acks = board.heard.messages::<COMMAND_ACK_DATA>();
        let (_, ack) = acks.last()?;
        assert_eq!(ack.command, MavCmd::MAV_CMD_RUN_PREARM_CHECKS);
        Some(ack.result).filter(|result| *result != MavResult::MAV_RESULT_IN_PROGRESS)
    };
    board.run_until(10 * MS, 2_000 * MS, |board| answer(board).is_some());
    // Its texts may follow.
    board.run(50 * MS);
    answer(board).expect("an answer at its end")
}

/// Returns the texts about items out of bounds.
fn named(board: &mut Board) -> Vec<String> {
    let mut texts = board.heard.texts();
    texts.retain(|text| text.starts_with("Self-test: "));
    texts
}

/// Returns what is to be reported about an item: nothing, if the board is sound.
fn named_unless(sound: bool, item: &str) -> Vec<String> {
    let named = (!sound).then(|| format!("Self-test: {item}"));
    named.into_iter().collect()
}

#[test]
fn a_sound_board_passes() {
    let mut board = Board::new(&image(), &[]);
    board.throttle = Throttle::Dshot(0);
    board.run(1_000 * MS);
    let result = check(&mut board);
    assert_eq!(named(&mut board), [""; 0]);
    assert_eq!(result, PASSED);
    // The comparators still protect it: their levels are as before.
    board.throttle = Throttle::Dshot(1_048);
    board.run(1_500 * MS);
    assert!(board.rpm() > 3_000.0, "{} rpm", board.rpm());
}

#[test]
fn a_comparator_that_never_trips_is_named_and_keeps_the_motor_off() {
    for (number, item) in [
        (1, "comparator_a"),
        (2, "comparator_b"),
        (4, "comparator_c"),
    ] {
        let mut board = Board::new(&image(), &[]);
        let defect = Defect::Stuck(false);
        board.world().set_comparator_defect(number, defect);
        board.throttle = Throttle::Dshot(0);
        board.run(1_000 * MS);
        assert_eq!(named(&mut board), named_unless(false, item));
        board.throttle = Throttle::Dshot(1_048);
        board.run(300 * MS);
        assert!(board.rpm().abs() < 1.0, "{} rpm", board.rpm());
        board.throttle = Throttle::Dshot(0);
        assert_eq!(check(&mut board), FAILED);
    }
}

/// A comparator that trips 30 mV, or 17.5 A, too early or too late is named; one that is off by 15 mV is not:
/// the bound is 0.4 of the board's range.
#[test]
fn a_comparator_whose_level_is_off_is_named_and_one_within_the_bounds_is_not() {
    for (offset_v, sound) in [(0.03, false), (-0.03, false), (0.015, true), (-0.015, true)] {
        let mut board = Board::new(&image(), &[]);
        let defect = Defect::Offset(offset_v);
        board.world().set_comparator_defect(2, defect);
        board.throttle = Throttle::Dshot(0);
        board.run(300 * MS);
        assert_eq!(
            named(&mut board),
            named_unless(sound, "comparator_b"),
            "{offset_v} V"
        );
    }
}

/// One that always trips keeps the bridge off by itself, and is named.
#[test]
fn a_comparator_that_always_trips_is_named() {
    let mut board = Board::new(&image(), &[]);
    let defect = Defect::Stuck(true);
    board.world().set_comparator_defect(4, defect);
    board.throttle = Throttle::Dshot(0);
    board.run(1_000 * MS);
    assert!(named(&mut board).contains(&"Self-test: comparator_c".into()));
    board.throttle = Throttle::Dshot(1_048);
    board.run(300 * MS);
    assert!(board.rpm().abs() < 1.0, "{} rpm", board.rpm());
}

/// Leg a is pulled before a current through the motor could reveal that its low side is shorted. The comparator
/// on its shunt ends that within the first pulse of its high side, which the rising duty limits to one of its
/// 256 steps: in that time 24 V drives 200 A through the 20 nH or so of a leg and its capacitors.
#[test]
fn a_shorted_low_side_of_the_first_leg_ends_the_test_in_one_short_pulse() {
    let mut board = Board::new(&image(), &[(ParamId::MotToneA, 0.0)]);
    board.run(1_000 * MS);
    let mut broken = InForce::default();
    broken.breaks.0[0].shorted[0] = true;
    board.world().bench().disturb(&InForce::default(), &broken);
    board.heard.scope = Some(Scope::default());
    assert_eq!(check(&mut board), FAILED);
    let gates = board.heard.scope.take().expect("it was there").gates;
    let first = gates.iter().position(|(.., gate)| gate.high);
    let first = first.expect("the high side is tried");
    let [(on_ns, 0, _), (off_ns, 0, off)] = gates[first..] else {
        panic!("more than one pulse: {:?}", &gates[first..]);
    };
    assert_eq!(off, Gate::default());
    let step_ns = ns(PWM_PERIOD / 256);
    assert!(off_ns - on_ns <= step_ns, "{} ns", off_ns - on_ns);
    let tripped_ns = board.world().tripped().map(ns);
    assert!(tripped_ns.is_some_and(|at| (on_ns..=off_ns).contains(&at)));
    let texts = board.heard.texts();
    assert!(texts.contains(&"Fault: over-current".into()), "{texts:?}");
    let [named] = &named(&mut board)[..] else {
        panic!("{texts:?}");
    };
    assert!(named.starts_with("Self-test: high_a"), "{named}");
}

/// What the bench breaks in a leg or in its phase's sensors, and the line that names it.
type Broken = (fn(&mut InForce, usize), &'static str);

const BROKEN: [Broken; 7] = [
    (|now, leg| now.breaks.0[leg].open[1] = true, "high"),
    (|now, leg| now.breaks.0[leg].open[0] = true, "low"),
    (|now, leg| now.breaks.0[leg].shorted[1] = true, "rest"),
    (|now, leg| now.breaks.0[leg].wire = true, "motor"),
    (|now, phase| now.stuck_a[phase] = Some(0.0), "noise"),
    (|now, phase| now.drift_a[phase] = 6.0, "zero"),
    (|now, phase| now.drift_a[phase] = -6.0, "zero"),
];

/// Runs the image's self-test on a defective board; returns what was named, and asserts that the motor stands.
fn named_by_check(spoil: impl FnOnce(&mut Board)) -> Vec<String> {
    // The tunes would find an offset first.
    let mut board = Board::new(&image(), &[(ParamId::MotToneA, 0.0)]);
    spoil(&mut board);
    board.run(300 * MS);
    assert_eq!(check(&mut board), FAILED);
    assert!(board.rpm().abs() < 60.0, "{} rpm", board.rpm());
    named(&mut board)
}

#[test]
fn each_half_bridge_and_each_current_sensor_is_named() {
    for (phase, letter) in ["a", "b", "c"].into_iter().enumerate() {
        for (number, (break_it, item)) in BROKEN.into_iter().enumerate() {
            let named = named_by_check(|board| {
                let mut now = InForce::default();
                break_it(&mut now, phase);
                board.world().bench().disturb(&InForce::default(), &now);
            });
            let item = format!("{item}_{letter}");
            assert!(
                named.iter().any(|text| text.contains(&item)),
                "{number}, {item}: {named:?}"
            );
        }
    }
}

#[test]
fn a_high_side_without_a_supply_of_its_driver_is_named() {
    for (leg, item) in ["high_a", "high_b", "high_c"].into_iter().enumerate() {
        let named = named_by_check(|board| board.world().open_gate_supply(leg));
        assert!(
            named.iter().any(|text| text.contains(item)),
            "{item}: {named:?}"
        );
    }
}

/// If torn off, it shows absolute zero; if shorted, it is hotter than any board.
#[test]
fn a_thermistor_that_is_torn_off_or_shorted_is_named() {
    for shown_c in [-273.15, -40.0, 10_000.0] {
        let mut board = Board::new(&image(), &[]);
        board.world().damage_thermistor(shown_c);
        board.run(500 * MS);
        let named = named(&mut board);
        assert!(
            named.iter().any(|text| text.contains("temperature")),
            "{shown_c}: {named:?}"
        );
    }
}

#[test]
fn option_bytes_by_which_a_pin_decides_are_named() {
    for (options, sound) in [(N_BOOT0, true), (N_BOOT0 | N_SW_BOOT0, false), (0, false)] {
        let mut board = Board::new(&image(), &[]);
        board.world().set_options(0xF3EF_F8AA | options);
        board.run(300 * MS);
        assert_eq!(
            named(&mut board),
            named_unless(sound, "option_bytes"),
            "{options:#x}"
        );
    }
}
