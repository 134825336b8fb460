//! The self-test and what it bars.

use siskin_units::AdcCounts;

use super::storage::ACCEPTED;
use super::*;
use crate::check::{Item, Kind, Own, Probe};
use crate::drive::Sample;
use mavlink::dialects::ardupilotmega::MavCmd;

/// Readings of a board at rest.
const AT_REST: Sample = Sample {
    currents: [AdcCounts::ZERO; 3],
    bus: AdcCounts::ZERO,
    terminals: [AdcCounts::ZERO; 3],
    hall: 7,
};

/// A board without measurements of its own.
pub(super) struct Plain;

impl Probe for Plain {
    fn sample(&mut self) -> Sample {
        AT_REST
    }

    fn own(&mut self, _: Item) -> Own {
        Own::Absent
    }
}

/// A board whose first comparator never trips, or is sound, and whose bridge conducts for some looks.
struct Bad {
    busy: u32,
    sound: bool,
}

impl Bad {
    fn new(busy: u32) -> Self {
        Self { busy, sound: false }
    }
}

impl Probe for Bad {
    fn sample(&mut self) -> Sample {
        AT_REST
    }

    fn own(&mut self, item: Item) -> Own {
        if item.kind == Kind::Comparator && self.busy > 0 {
            self.busy -= 1;
            return Own::Busy;
        }
        match (item.kind, item.phase) {
            (Kind::Comparator, 0) if !self.sound => Own::Value(f32::NAN),
            (Kind::Comparator, _) => Own::Value(0.0),
            _ => Own::Absent,
        }
    }
}

impl Bench {
    fn test_itself_ms(&mut self, probe: &mut impl Probe, ms: u32) {
        for _ in 0..ms {
            self.frames(1, 0);
            self.esc.test_itself(&self.snapshot, probe);
        }
    }
}

/// Anything that may be sent at any time can interrupt it: then nothing is measured.
#[test]
fn a_self_test_lifts_no_bar_before_it_has_measured() {
    let mut bench = Bench::at_power_up();
    let mut probe = Bad::new(0);
    bench.test_itself_ms(&mut probe, 1_500);
    assert!(!bench.esc.telemetry().armed, "barred since power-up");
    bench.results.clear();
    bench.command(MavCmd::MAV_CMD_RUN_PREARM_CHECKS, 0.0);
    for _ in 0..1_500 {
        // Without its looks.
        bench.frames(1, 0);
    }
    assert_eq!(bench.results[0], MavResult::MAV_RESULT_IN_PROGRESS);
    assert!(!bench.esc.telemetry().armed, "not before it has looked");
    bench.test_itself_ms(&mut probe, 1_500);
    assert_ne!(bench.results.last(), Some(&ACCEPTED));
    assert!(!bench.esc.telemetry().armed, "still barred");
}

/// Comparators are searched only while no switch is on: until then no tune starts, and a test waits.
#[test]
fn what_the_board_measures_waits_for_a_bridge_that_is_off() {
    let mut bench = Bench::at_power_up();
    let mut probe = Bad::new(50);
    let misfit = |bench: &Bench| bench.texts.iter().any(|text| text.contains("comparator_a"));
    let sounds = |bench: &Bench| matches!(bench.throttle.setpoint(), Setpoint::Tone { .. });
    bench.test_itself_ms(&mut probe, 50);
    assert!(probe.busy > 0 && !misfit(&bench) && !sounds(&bench));
    bench.test_itself_ms(&mut probe, 20);
    assert!(probe.busy == 0 && misfit(&bench) && !sounds(&bench));

    let mut bench = Bench::at_power_up();
    let mut probe = Bad {
        busy: 50,
        sound: true,
    };
    bench.test_itself_ms(&mut probe, 50);
    assert!(probe.busy > 0 && !sounds(&bench));
    bench.test_itself_ms(&mut probe, 20);
    assert!(probe.busy == 0 && sounds(&bench));
    bench.command(MavCmd::MAV_CMD_RUN_PREARM_CHECKS, 0.0);
    probe.busy = 50;
    bench.test_itself_ms(&mut probe, 100);
    assert!(probe.busy > 0);
    assert_eq!(bench.results.len(), 1, "it is listening");
    bench.test_itself_ms(&mut probe, 100);
    assert_eq!((probe.busy, bench.results.len()), (0, 2), "it goes on");
}

/// However long a board takes: comparators not measured yet may protect nothing. What the wire holds meanwhile
/// does not arm later.
#[test]
fn nothing_arms_before_the_board_has_been_measured() {
    let mut bench = Bench::at_power_up();
    bench.frames(1_000, 0);
    assert!(!bench.esc.telemetry().armed, "nothing is measured");
    bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, 1.0);
    assert_ne!(bench.results.last(), Some(&ACCEPTED));
    bench.test_itself_ms(&mut Plain, 3);
    bench.frames(299, 0);
    assert!(
        !bench.esc.telemetry().armed,
        "its time begins with the measurement's end"
    );
    bench.frames(3, 0);
    assert!(bench.esc.telemetry().armed);
}

/// The wire is heard before the tasks have run for the first time.
#[test]
fn nothing_arms_before_the_tasks_have_run() {
    let mut throttle = Throttle::new(TICK_HZ, &Params::of(&BOSSO_MOTOR), &Board::BENCH);
    let zero = dshot::Frame {
        value: 0,
        telemetry: false,
    };
    for at_us in (0..500_000).step_by(1_000) {
        let ticks = |after_ns: u64| ((at_us * 1_000 + after_ns) * 17 / 100) as u32;
        for (at_ns, level) in edges(zero.to_bits(), Rate::Dshot600) {
            throttle.edge(at_us, ticks(at_ns.into()), level);
        }
        throttle.settle(at_us, ticks(40_000));
    }
    assert!(throttle.signal().is_some(), "it has been heard");
    assert_eq!(throttle.command(), Command::Stop);
}

/// Whatever bars the motor, nothing energises its phases, whoever asks.
#[test]
fn a_barred_motor_is_not_energised() {
    let lost = |bench: &mut Bench| bench.esc.lose_stored();
    let unmeasured = |_: &mut Bench| {};
    let defect = |bench: &mut Bench| bench.test_itself_ms(&mut Bad::new(0), 10);
    let unfit = |bench: &mut Bench| {
        bench.set("CTL_BW_CUR_HZ", 2000.0);
        bench.poll();
    };
    type Act<'a> = &'a dyn Fn(&mut Bench);
    let bars: [(&str, bool, Act); 4] = [
        ("parameters that do not fit", true, &unfit),
        ("settings lost", true, &lost),
        ("not measured yet", false, &unmeasured),
        ("a defect", false, &defect),
    ];
    let identify = |bench: &mut Bench| bench.command(MavCmd::MAV_CMD_USER_1, 1.0);
    let asked = |bench: &mut Bench| bench.set("MOT_IDENTIFY", 1.0);
    let by_stick = |bench: &mut Bench| {
        bench
            .esc
            .identify_by_stick(&mut bench.throttle, bench.now_us);
    };
    let test = |bench: &mut Bench| bench.command(MavCmd::MAV_CMD_ACTUATOR_TEST, 0.1);
    let check = |bench: &mut Bench| bench.command(MavCmd::MAV_CMD_RUN_PREARM_CHECKS, 0.0);
    let beep = |bench: &mut Bench| bench.frames(10, 1);
    let throttle = |bench: &mut Bench| bench.frames(20, 1000);
    let uses: [(&str, Act); 7] = [
        ("identification", &identify),
        ("MOT_IDENTIFY", &asked),
        ("identification by the stick", &by_stick),
        ("motor test", &test),
        ("self-test", &check),
        ("note", &beep),
        ("throttle", &throttle),
    ];
    for (why, measured, bar) in bars {
        for (what, ask) in uses {
            let mut bench = Bench::at_power_up();
            if measured {
                bench.test_itself_ms(&mut Plain, 10);
            }
            bar(&mut bench);
            bench.frames(500, 0);
            ask(&mut bench);
            for _ in 0..1_500 {
                if what != "throttle" {
                    bench.frames(1, 0);
                }
                bench.poll();
                if why != "not measured yet" {
                    bench.esc.test_itself(&bench.snapshot, &mut Bad::new(0));
                }
                let setpoint = bench.throttle.setpoint();
                let rests = matches!(setpoint, Setpoint::Stop | Setpoint::Zero);
                assert!(rests, "{why}, {what}: {setpoint:?}");
            }
        }
    }
}
