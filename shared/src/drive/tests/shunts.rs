//! Two shunts: the third phase follows from the other two.

use siskin_params::choice::StaMode;
use siskin_params::{BOSSO_MOTOR, Shunts};

use super::*;

/// Readings of phase c, which has no sensor.
const NONSENSE_A: [f64; 4] = [0.0, 39.0, -39.0, 7.3];

fn with_two_shunts() -> Bench {
    let board = Board {
        shunts: Shunts::Two,
        ..Board::BENCH
    };
    let mut params = Params::of(&BOSSO_MOTOR);
    let (stated, value) = StaMode::Stated.setting();
    params.set(stated, value).expect("in range");
    let config = build(&params, &board).expect("it makes a drive");
    let state = State::new(&config);
    Bench { config, state }
}

/// A rotating current of some amperes.
fn turning(period: u32) -> [f64; 3] {
    [0.0, 1.0, 2.0].map(|phase| 4.0 * (TAU * (f64::from(period) / 97.0 - phase / 3.0)).sin())
}

#[test]
fn the_third_phase_is_never_read() {
    let turn = with_two_shunts().turn();
    let course = |nonsense_a: Option<f64>| {
        let mut bench = with_two_shunts();
        let mut bridges = Vec::new();
        let mut driven = 0;
        for _ in 0..8000 {
            // The offsets are measured without current.
            let [a, b, c] = if bench.phase().drives() {
                driven += 1;
                turning(driven)
            } else {
                [0.0; 3]
            };
            let sample = sample([a, b, nonsense_a.unwrap_or(c)], 24.0);
            bridges.push(bench.run(1, sample, turn));
            let i = bench.state.snapshot().i;
            let [d, q] = [i.d, i.q].map(|i| f64::from(bench.config.scale.amperes(i)));
            let seen_a = d.hypot(q);
            // A count is 0.02 A, and the third phase combines two.
            assert!(
                driven < 2 || (seen_a - 4.0).abs() < 0.06,
                "{driven}: {seen_a} A"
            );
        }
        assert!(bench.faults().is_empty() && driven > 1000, "{driven}");
        bridges
    };
    let wanted = course(None);
    for nonsense_a in NONSENSE_A {
        assert!(course(Some(nonsense_a)) == wanted, "{nonsense_a} A");
    }
}

#[test]
fn an_over_current_of_the_third_phase_is_seen_in_the_other_two() {
    let mut bench = with_two_shunts();
    let turn = bench.turn();
    bench.until(Phase::Park, turn);
    // The trip is at 1.4 times 20 A.
    let above = sample([14.1, 14.0, 0.0], 24.0);
    bench.run(1, above, turn);
    assert!(bench.faults().is_empty());
    assert_eq!(bench.run(1, above, turn), Bridge::Off);
    assert!(bench.faults().contains(Fault::OverCurrent));
}
