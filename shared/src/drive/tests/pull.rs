//! Legs pulled by the self-test: what switches, and what ends it.

use siskin_units::Duty;

use super::*;
use crate::drive::Pull;

/// Returns the bridge over this many periods of a pull, with this current into phase b.
fn pulled(bench: &mut Bench, pull: Pull, periods: usize, b: i32) -> Vec<Bridge> {
    let mut sample = sample([0.0; 3], 24.0);
    sample.currents[1] = AdcCounts::from_num(b);
    let setpoint = Setpoint::Pull(pull);
    let step = |_| step(&bench.config, &mut bench.state, sample, setpoint);
    (0..periods).map(step).collect()
}

fn standing() -> Bench {
    let mut bench = Bench::new(&[]);
    bench.until(Phase::Tone, Setpoint::Pull(Pull::Open));
    bench
}

#[test]
fn all_switches_are_off_until_the_shaft_is_seen_to_stand() {
    let mut bench = Bench::new(&[]);
    let pull = Setpoint::Pull(Pull::UpB);
    let mut bridges = (0..2000).map(|_| (bench.quiet(1, pull), bench.phase()));
    let first = bridges.find(|(bridge, _)| *bridge != Bridge::Off);
    assert!(matches!(first, Some((Bridge::Legs(_), Phase::Tone))));
    // A stop ends it at once.
    assert_eq!(bench.quiet(1, Setpoint::Stop), Bridge::Off);
    assert_eq!(bench.phase(), Phase::Idle);
}

#[test]
fn a_leg_comes_up_by_a_step_a_period_and_stays() {
    let mut bench = standing();
    for (n, bridge) in pulled(&mut bench, Pull::UpC, 300, 0)
        .into_iter()
        .enumerate()
    {
        let duty = if n < 255 {
            Duty::from_num((n + 1) as f32 / 256.0)
        } else {
            Duty::MAX
        };
        assert_eq!(bridge, Bridge::Legs([None, None, Some(duty)]), "{n}");
    }
    // Another pull starts over.
    let first = pulled(&mut bench, Pull::UpA, 1, 0);
    let step = Duty::from_num(1.0 / 256.0);
    assert_eq!(first, [Bridge::Legs([Some(step), None, None])]);
}

#[test]
fn a_current_through_two_legs_ends_at_that_of_a_test_or_a_quarter() {
    let mut bench = standing();
    let bridges = pulled(&mut bench, Pull::ThroughC, 100, 0);
    let last = Duty::from_num(63.0 / 256.0);
    assert_eq!(
        bridges[62],
        Bridge::Legs([Some(Duty::ZERO), None, Some(last)])
    );
    assert!(bridges[63..].iter().all(|bridge| *bridge == Bridge::Off));

    let test_a = bench.config.scale.amperes(bench.config.test_current);
    let counts = (test_a / Board::BENCH.current_a_per_count) as i32 + 2;
    let mut bench = standing();
    let bridges = pulled(&mut bench, Pull::ThroughC, 20, 0);
    assert!(bridges.iter().all(|bridge| *bridge != Bridge::Off));
    assert_eq!(
        pulled(&mut bench, Pull::ThroughC, 1, -counts),
        [Bridge::Off]
    );
    // The last current remains readable.
    let bridges = pulled(&mut bench, Pull::ThroughC, 50, 0);
    assert!(bridges.iter().all(|bridge| *bridge == Bridge::Off));
    let told_a = bench.config.scale.amperes(bench.state.snapshot().i.q);
    assert!((told_a + test_a).abs() < 0.1, "{told_a} of {test_a}");
}

#[test]
fn every_pull_has_a_number() {
    for (number, pull) in (0..).zip(Pull::ALL) {
        assert_eq!((pull as u8, Pull::from_number(number)), (number, pull));
    }
    assert_eq!(Pull::from_number(7), Pull::Open);
}
