//! Warnings of conditions that a motor keeps running with.

use siskin_units::AdcCounts;

use super::*;
use crate::drive::Limit;

#[test]
fn what_a_motor_goes_on_with_is_told_once_until_it_rests() {
    let mut bench = Bench::new();
    for _ in 0..2 {
        bench.snapshot.phase = Phase::Run;
        // A fifth of the board's range.
        let off = AdcCounts::lit("400");
        bench.snapshot.currents = [off, AdcCounts::ZERO, AdcCounts::ZERO];
        bench.wait_ms(200);
        assert_eq!(bench.texts, ["current sensor drifts"]);
        let limits = bench.esc.telemetry().limits;
        assert!(limits.contains(Limit::SensorDrift), "{limits:?}");

        bench.snapshot.phase = Phase::Idle;
        bench.wait_ms(10);
        assert!(bench.esc.telemetry().limits.is_empty());
        bench.texts.clear();
    }
}
