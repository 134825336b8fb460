//! Motor tests by MAVLink: when one may start, and what ends it.

use super::*;

#[test]
fn a_test_turns_for_its_time() {
    let mut bench = Bench::new();
    assert_eq!(bench.test(0.5, 2.0), Ok(()));
    assert_eq!(
        bench.authority.command(),
        Command::Test(Share::from_num(0.5))
    );
    bench.wait(1_999_999);
    assert!(bench.turns());
    bench.wait(1);
    assert!(!bench.turns());
    assert_eq!(bench.test(1.0, 3.0), Ok(()));
    assert_eq!(bench.authority.command(), Command::Test(Share::MAX));
    assert_eq!(bench.test(0.3, 0.0), Ok(()));
    assert!(!bench.turns());
}

#[test]
fn a_test_ends_at_throttle_fault_disarming_and_nan() {
    for (end, armed) in [(0, true), (0, false), (1, true), (2, true), (3, false)] {
        let mut bench = if armed { Bench::armed() } else { Bench::new() };
        bench.play(2, event(0));
        assert_eq!(bench.test(0.1, 3.0), Ok(()));
        bench.play(2, event(0));
        bench.play(2, Event::Bad);
        assert!(matches!(bench.authority.command(), Command::Test(_)));
        match end {
            0 => {
                bench.play(1, event(48));
                assert!(!bench.turns());
                bench.play(3, event(48));
                assert_eq!(bench.turns(), armed);
                bench.play(1, event(0));
            }
            1 => bench.authority.fault(true),
            2 => bench.authority.disarm(),
            _ => assert_eq!(bench.test(f32::NAN, f32::NAN), Ok(())),
        }
        assert!(!bench.turns(), "{end}");
    }
}

#[test]
fn tests_out_of_range_are_refused() {
    let mut bench = Bench::new();
    for (value, duration_s) in [
        (-0.01, 1.0),
        (f32::NEG_INFINITY, 1.0),
        (1.01, 1.0),
        (f32::INFINITY, 1.0),
        (0.5, -0.1),
        (0.5, 3.01),
        (0.5, f32::NAN),
        (0.5, f32::INFINITY),
    ] {
        assert_eq!(
            bench.test(value, duration_s),
            Err(TestError::OutOfRange),
            "{value} {duration_s}"
        );
        assert!(!bench.turns());
    }
}

#[test]
fn tests_need_a_motor_at_rest_and_a_wire_at_zero_or_silent() {
    let rejected = Err(TestError::TemporarilyRejected);
    for (stopped, faulted) in [(false, false), (true, true), (false, true)] {
        let mut bench = Bench::new();
        let drive = DriveStatus { stopped, faulted };
        let result = bench.authority.actuator_test(bench.now_us, 0.1, 1.0, drive);
        assert_eq!(result, rejected);
    }
    let mut bench = Bench::new();
    bench.play(1, event(48));
    assert_eq!(bench.test(0.1, 1.0), rejected, "unarmed, but open");
    bench.play(1, event(0));
    assert_eq!(bench.test(0.1, 1.0), Ok(()));
    let mut bench = Bench::new();
    bench.play(1, Event::Bad);
    assert_eq!(bench.test(0.1, 1.0), rejected, "neither silent nor valid");
    bench.wait(100_001);
    assert_eq!(bench.test(0.1, 1.0), Ok(()));
}

#[test]
fn a_test_of_nothing_turns_nothing() {
    let mut bench = Bench::new();
    assert_eq!(bench.test(0.0, 1.0), Ok(()));
    assert!(!bench.turns());
}

#[test]
fn with_two_directions_either_turns_and_a_test_may_be_negative() {
    let mut bench = Bench::new();
    bench.authority.set_reading(Reading {
        two_directions: true,
        ..Reading::default()
    });
    bench.play(301, event(0));
    bench.play(4, event(48));
    let least = Share::from_bits(-1);
    assert_eq!(bench.authority.command(), Command::Throttle(least));
    bench.after(1_000, event(1048));
    assert_eq!(bench.authority.command(), Command::Throttle(Share::ZERO));
    bench.after(1_000, event(0));
    assert_eq!(bench.authority.command(), Command::Zero);
    assert_eq!(bench.test(-0.5, 1.0), Ok(()));
    assert_eq!(
        bench.authority.command(),
        Command::Test(Share::from_num(-0.5))
    );
    assert_eq!(bench.test(-1.1, 1.0), Err(TestError::OutOfRange));
}
