//! An armed wire at zero opens after several throttle frames in a row.

use std::collections::BTreeMap;

use super::*;

/// Returns the probability that random words, one per millisecond, turn the motor of an armed wire at zero
/// before they count as a lost signal. Of the 2048 values that pass the check, 48 are not throttle. Paths less
/// likely than `LEAST` are dropped; together they are less than a thousandth of the result.
fn likely_turned_by_noise() -> f64 {
    const LEAST: f64 = 1e-12;
    const GOOD: f64 = 1.0 / 16.0;
    const ZERO: f64 = 48.0 / 2048.0;
    let armed = Bench::armed();
    // Keyed by what determines the future: trust, throttle frames in a row and age of the signal.
    let mut states = BTreeMap::from([((0, 0, 0), (1.0, armed.authority))]);
    let mut now_us = armed.now_us;
    let mut turned = 0.0;
    while !states.is_empty() {
        now_us += 1_000;
        let mut next = BTreeMap::new();
        for (likely, authority) in states.into_values() {
            for (word, share) in [
                (Event::Bad, 1.0 - GOOD),
                (event(0), GOOD * ZERO),
                (event(1000), GOOD * (1.0 - ZERO)),
            ] {
                let mut heard = authority.clone();
                heard.wire(now_us, word, IDENTIFIED);
                match heard.command() {
                    Command::Throttle(_) => turned += likely * share,
                    Command::Zero => {
                        let valid_us = heard.valid.expect("a signal").at_us;
                        let key = (heard.trust.count(), heard.opening, valid_us);
                        next.entry(key).or_insert((0.0, heard)).0 += likely * share;
                    }
                    command => assert_eq!(command, Command::Stop, "lost"),
                }
            }
        }
        next.retain(|_, (likely, _)| *likely > LEAST);
        states = next;
    }
    turned
}

#[test]
fn of_wires_that_become_noise_at_zero_one_in_2170_turns_the_motor() {
    let turned = likely_turned_by_noise();
    assert!((turned * 2_170.0 - 1.0).abs() < 0.01, "{turned:e}");
}

#[test]
fn the_fourth_throttle_in_a_row_opens() {
    let mut bench = Bench::armed();
    // A throttle that does not agree begins a row of its own.
    for between in [event(0), event(47), Event::Bad, event(48)] {
        bench.play(3, event(1000));
        assert_eq!(bench.authority.command(), Command::Zero);
        bench.play(1, between);
    }
    bench.play(3, event(1000));
    assert_eq!(bench.authority.command(), Command::Zero);
    bench.play(1, event(1100));
    assert!(matches!(
        bench.authority.command(),
        Command::Throttle(throttle) if throttle > 0.5
    ));
    // Once open, it obeys each frame at once, even after bad ones.
    bench.play(1, event(2047));
    assert_eq!(bench.authority.command(), Command::Throttle(Share::MAX));
    bench.play(5, Event::Bad);
    bench.play(1, event(48));
    assert_eq!(bench.authority.command(), Command::Throttle(Share::ZERO));
    bench.play(10, event(0));
    assert_eq!(bench.authority.command(), Command::Zero);
    bench.play(3, event(48));
    assert_eq!(bench.authority.command(), Command::Zero);
    bench.play(1, event(48));
    assert!(bench.turns());
}

#[test]
fn few_zeros_in_flight_do_not_close() {
    let mut bench = Bench::open(1000);
    for between in [event(0), event(47)] {
        bench.play(9, between);
        assert_eq!(bench.authority.command(), Command::Zero);
        bench.play(1, Event::Bad);
        bench.play(1, event(1000));
        assert!(bench.turns());
    }
}

#[test]
fn throttles_that_do_not_open_yet_are_a_signal_and_end_a_test() {
    let mut bench = Bench::armed();
    assert_eq!(bench.test(0.1, 3.0), Ok(()));
    bench.after(90_000, event(1000));
    assert!(!bench.turns());
    bench.wait(100_000);
    assert!(bench.authority.armed());
    bench.wait(1);
    assert!(!bench.authority.armed());
}
