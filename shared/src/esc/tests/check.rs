//! The self-test and what it bars.

use super::storage::ACCEPTED;
use super::*;
use crate::check::{Item, Kind, Probe};
use crate::drive::Sample;
use crate::units::AdcCounts;
use mavlink::dialects::ardupilotmega::MavCmd;

/// A board whose first comparator trips nowhere.
struct Bad {
    sample: Sample,
}

impl Probe for Bad {
    fn sample(&mut self) -> Sample {
        self.sample
    }

    fn own(&mut self, item: Item) -> Option<f32> {
        (item.kind == Kind::Comparator).then_some(if item.phase == 0 { f32::NAN } else { 0.0 })
    }
}

impl Bench {
    fn test_itself_ms(&mut self, probe: &mut Bad, ms: u32) {
        for _ in 0..ms {
            self.frames(1, 0);
            self.esc.test_itself(&self.snapshot, probe);
        }
    }
}

/// It is broken off by what may be sent at any time: nothing is measured then.
#[test]
fn a_self_test_lifts_no_bar_before_it_has_measured() {
    let mut bench = Bench::new();
    let mut probe = Bad {
        sample: Sample {
            currents: [AdcCounts::ZERO; 3],
            bus: AdcCounts::ZERO,
            terminals: [AdcCounts::ZERO; 3],
            hall: 7,
        },
    };
    bench.test_itself_ms(&mut probe, 1_500);
    assert!(!bench.esc.telemetry().armed, "barred since power-up");
    bench.results.clear();
    bench.command(MavCmd::MAV_CMD_RUN_PREARM_CHECKS, 0.0);
    for _ in 0..1_500 {
        // Its looks do not come.
        bench.frames(1, 0);
    }
    assert_eq!(bench.results[0], MavResult::MAV_RESULT_IN_PROGRESS);
    assert!(!bench.esc.telemetry().armed, "not before it has looked");
    bench.test_itself_ms(&mut probe, 1_500);
    assert_ne!(bench.results.last(), Some(&ACCEPTED));
    assert!(!bench.esc.telemetry().armed, "still barred");
}
