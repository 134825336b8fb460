//! The time of signatures: who sets it, and how far ahead it may be.

use super::*;

#[test]
fn a_time_ahead_locks_nobody_out() {
    let mut bench = keyed();
    for ahead in [61 * SECOND, YEAR, 10 * YEAR, LAST - TODAY] {
        assert!(
            !takes(&mut bench, 5.0, STATION, 1, TODAY + ahead),
            "{ahead}"
        );
        let off = setup([0; 32], TODAY + ahead);
        bench.receive(&signed(STATION, &off, &KEY, 1, TODAY + ahead));
        // By a frame that is accepted.
        let far = setup(KEY, TODAY + ahead);
        bench.receive(&signed(STATION, &far, &KEY, 9, TODAY + ahead / YEAR));
        let refused = bench.answers();
        let text = "Signing refused: bad time";
        assert_eq!(texts(&refused), [text], "{ahead}");
    }
    assert!(takes(&mut bench, 6.0, STATION, 2, TODAY + SECOND));
    assert!(takes(&mut bench, 7.0, STATION, 1, TODAY + 60 * SECOND));
}

/// The ESC has no clock.
#[test]
fn the_first_frame_after_a_start_tells_the_time_within_five_years() {
    let kept = keyed().component.kept_signing();
    let started = || {
        let mut bench = Bench::new();
        bench.component.keep_signing(kept);
        bench
    };
    for ahead in [10 * YEAR, LAST - TODAY] {
        let mut bench = started();
        assert!(
            !takes(&mut bench, 5.0, STATION, 1, TODAY + ahead),
            "{ahead}"
        );
        let later = TODAY + 20 * SECOND;
        assert!(takes(&mut bench, 5.0, STATION, 1, later));
        assert!(!takes(&mut bench, 6.0, STATION, 1, later + 61 * SECOND));
        assert!(takes(&mut bench, 7.0, STATION, 2, later + 60 * SECOND));
    }
    let mut bench = started();
    assert!(takes(&mut bench, 5.0, STATION, 1, TODAY + 4 * YEAR));
}

/// A frame from a recording never heard before may come first, and a machine may sleep.
#[test]
fn a_minute_without_a_frame_lets_one_tell_the_time_again() {
    let mut bench = keyed();
    bench.run_ms(59_000);
    let hour = TODAY + 3_600 * SECOND;
    assert!(!takes(&mut bench, 5.0, STATION, 1, hour));
    assert!(!takes(&mut bench, 5.0, STATION, 1, LAST));
    bench.run_ms(2_000);
    assert!(!takes(&mut bench, 5.0, STATION, 1, LAST), "never");
    assert!(takes(&mut bench, 5.0, STATION, 1, hour));
}

/// An unheard hour from the day before, one frame a second: correct clocks are locked out while it plays, and no
/// longer.
#[test]
fn a_recording_that_is_played_slowly_locks_out_for_its_own_length_at_most() {
    let mut bench = keyed();
    bench.now_us += 61_000_000;
    let begin = TODAY + 3_600 * SECOND;
    let mut played = 0;
    for frame in 0..3_600 {
        let at = begin + frame * SECOND;
        if takes(&mut bench, 5.0 + frame as f32 / 1000.0, STATION, 1, at) {
            played += 1;
            bench.now_us += 59_000_000;
        }
    }
    assert!((60..=63).contains(&played), "{played}");
    bench.now_us += 2_000_000;
    assert!(takes(&mut bench, 8.0, STATION, 2, TODAY + 86_400 * SECOND));
}

/// No clock is known before it.
#[test]
fn a_first_key_from_a_clock_ahead_goes_with_its_station_and_a_restart() {
    let mut bench = Bench::new();
    let ahead = TODAY + 10 * YEAR;
    give(&mut bench, KEY, &[0; 32], ahead);
    assert!(!takes(&mut bench, 5.0, STATION, 1, TODAY));
    give(&mut bench, [0; 32], &KEY, ahead + SECOND);
    let kept = bench.component.kept_signing();
    let mut bench = Bench::new();
    bench.component.keep_signing(kept);
    give(&mut bench, KEY, &[0; 32], TODAY);
    assert!(takes(&mut bench, 5.0, STATION, 1, TODAY + SECOND));
}
