//! Pulses, signals before and after identification, and other readings.

use super::*;
use crate::signal::Pulse;

fn pulse(width_us: u32) -> Event {
    Event::Pulse {
        kind: Pulse::Servo,
        width_ns: width_us * 1000,
        likeness: Likeness::Both,
        near: true,
    }
}

const SERVO: Option<Signal> = Some(Signal::Pulse(Pulse::Servo));

impl Bench {
    /// Events of any signal, 20 ms apart, and the signal identified by then.
    fn play_as(&mut self, count: u32, event: Event, identified: Option<Signal>) {
        for _ in 0..count {
            self.now_us += 20_000;
            self.authority.wire(self.now_us, event, identified);
        }
    }
}

#[test]
fn zero_pulses_arm_at_the_exact_time() {
    let mut bench = Bench::new();
    bench.play_as(15, pulse(1000), SERVO);
    assert!(!bench.authority.armed(), "280 ms");
    bench.play_as(1, pulse(1000), SERVO);
    assert!(bench.authority.armed(), "300 ms");
    bench.play_as(3, pulse(1510), SERVO);
    assert_eq!(bench.authority.command(), Command::Zero);
    bench.play_as(1, pulse(1510), SERVO);
    let Command::Throttle(throttle) = bench.authority.command() else {
        panic!("half throttle");
    };
    assert!((throttle.to_num::<f64>() - 0.5).abs() < 1e-6);
    bench.play_as(1, pulse(1020), SERVO);
    assert_eq!(bench.authority.command(), Command::Zero);
}

#[test]
fn five_pulses_arm_and_not_four() {
    let mut bench = Bench::new();
    bench.authority.set_timing(Timing {
        arm_us: 10_000,
        ..TIMING
    });
    bench.play_as(4, pulse(1000), SERVO);
    assert!(!bench.authority.armed());
    bench.play_as(1, pulse(1000), SERVO);
    assert!(bench.authority.armed());
}

#[test]
fn what_is_not_identified_counts_and_does_not_arm() {
    let mut bench = Bench::new();
    bench.play_as(100, pulse(1000), None);
    assert!(!bench.authority.armed());
    assert_eq!(bench.authority.arm(bench.now_us), Err(Denied));
    assert_eq!(bench.test(0.1, 1.0), Err(TestError::TemporarilyRejected));
    bench.play_as(1, pulse(1000), SERVO);
    assert!(
        bench.authority.armed(),
        "the time has counted from the first"
    );
    // Before identification an open throttle does not count as one.
    let mut bench = Bench::new();
    bench.play_as(100, pulse(1600), None);
    assert!(!bench.authority.refuses() && !bench.turns());
    bench.play_as(1, pulse(1600), SERVO);
    assert!(bench.authority.refuses() && !bench.turns());
}

#[test]
fn another_signal_begins_anew() {
    let mut bench = Bench::new();
    bench.play_as(100, pulse(1000), None);
    bench.play_as(1, event(0), None);
    bench.play_as(15, pulse(1000), SERVO);
    assert!(!bench.authority.armed(), "280 ms");
    bench.play_as(1, pulse(1000), SERVO);
    assert!(bench.authority.armed());
    bench.play_as(1, event(0), IDENTIFIED);
    assert!(!bench.authority.armed());
}

#[test]
fn signals_other_than_the_identified_one_are_bad() {
    let mut bench = Bench::open(1000);
    // Events 20 ms apart: the fifth finds the signal lost.
    bench.play_as(5, pulse(1800), IDENTIFIED);
    let held = bench.authority.command();
    assert!(matches!(held, Command::Throttle(throttle) if throttle < 0.5));
    bench.play_as(1, pulse(1800), IDENTIFIED);
    assert!(!bench.turns() && !bench.authority.armed());
}

#[test]
fn another_reading_must_be_armed_anew_and_the_same_need_not() {
    let mut bench = Bench::new();
    bench.play_as(16, pulse(1000), SERVO);
    bench.authority.set_reading(Reading::default());
    assert!(bench.authority.armed());
    bench.authority.set_reading(Reading {
        two_directions: true,
        ..Reading::default()
    });
    assert!(!bench.authority.armed());
    // What was zero is now full reverse.
    bench.play_as(100, pulse(1000), SERVO);
    assert!(!bench.authority.armed() && !bench.turns());
    assert!(bench.authority.refuses());
    bench.play_as(16, pulse(1500), SERVO);
    bench.play_as(4, pulse(1000), SERVO);
    assert!(bench.turns());
}

#[test]
fn a_frame_that_passes_by_chance_neither_turns_nor_arms() {
    for chance in [48, 1048, 2047] {
        let mut bench = Bench::armed();
        bench.after(1_000, event(chance));
        assert!(!bench.turns());
        bench.after(1_000, event(0));
        assert_eq!(bench.authority.command(), Command::Zero);
    }
    // On an open wire, isolated zeros do not arm.
    let mut bench = Bench::new();
    for _ in 0..10_000 {
        bench.play(29, event(1000));
        bench.play(1, event(0));
        assert!(!bench.authority.armed());
    }
}

#[test]
fn a_loss_is_told_once() {
    let mut bench = Bench::armed();
    assert!(!bench.authority.poll(bench.now_us + 100_000));
    assert!(bench.authority.poll(bench.now_us + 100_001));
    assert!(!bench.authority.poll(bench.now_us + 200_000));
    bench.now_us += 300_000;
    bench.play(1, Event::Bad);
    assert!(!bench.authority.poll(bench.now_us + 200_000));
}
