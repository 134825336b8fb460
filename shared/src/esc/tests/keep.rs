//! Settings stored unasked, and when.

use siskin_throttle::News;
use siskin_throttle::calibration::Step;
use siskin_throttle::endpoints::EndPoints;

use super::storage::{ACCEPTED, REBOOT, REJECTED, STORAGE};
use super::*;
use crate::mavlink::{KeptSigning, Key};
use crate::statistics::Statistics;
use crate::store::{Integrity, Kept, Loaded};
use mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, MavCmd, PARAM_SET_DATA, SETUP_SIGNING_DATA,
};
use mavlink::types::CharArray;

mod wear;

const INTERVAL: MavCmd = MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL;

impl Bench {
    pub(super) fn set(&mut self, name: &str, value: f32) {
        let mut id = [0; 16];
        id[..name.len()].copy_from_slice(name.as_bytes());
        self.message(&PARAM_SET_DATA {
            param_value: value,
            target_system: 1,
            target_component: 1,
            param_id: CharArray::new(id),
            ..PARAM_SET_DATA::default()
        });
    }

    /// Waits for a save in 1 ms steps; returns how long it took.
    fn keeps_after_ms(&mut self) -> u32 {
        for ms in 1..10_000 {
            self.wait_ms(1);
            if self.requests.contains(&Request::Keep) {
                return ms;
            }
        }
        panic!("nothing is kept: {:?}", self.requests);
    }
}

/// At rest, with the start-up tune over.
fn rested() -> Bench {
    let mut bench = Bench::new();
    bench.wait_ms(3_000);
    assert_eq!(bench.requests, []);
    bench.texts.clear();
    bench
}

#[test]
fn a_value_is_kept_after_a_quiet_second() {
    let mut bench = rested();
    bench.set("LIM_PHASE_A", 12.5);
    bench.wait_ms(700);
    bench.set("MOT_POLE_PAIRS", 7.0);
    assert_eq!(bench.keeps_after_ms(), 1_001, "both at once");
    let kept = bench.esc.kept();
    assert_eq!(kept.params.get(ParamId::LimPhaseA), 12.5);
    assert_eq!(kept.params.get(ParamId::MotPolePairs), 7.0);
    bench.storage_done(Ok(()));
    bench.requests.clear();
    bench.wait_ms(5_000);
    assert_eq!(bench.requests, [], "once");
    assert_eq!(bench.texts, Vec::<String>::new(), "nobody has asked");
}

#[test]
fn a_refused_value_is_none() {
    let mut bench = rested();
    bench.set("LIM_PHASE_A", -1.0);
    bench.set("NO_SUCH", 1.0);
    bench.command(MavCmd::MAV_CMD_REQUEST_MESSAGE, 0.0);
    bench.command(INTERVAL, 999.0);
    bench.wait_ms(5_000);
    assert_eq!(bench.requests, []);
}

#[test]
fn an_interval_and_the_key_are_kept_as_well() {
    let mut bench = rested();
    bench.message(&COMMAND_LONG_DATA {
        param1: 291.0,
        param2: 20_000.0,
        command: INTERVAL,
        target_system: 1,
        target_component: 1,
        ..COMMAND_LONG_DATA::default()
    });
    assert_eq!(bench.keeps_after_ms(), 1_001);
    let intervals = bench.esc.kept().intervals;
    assert_ne!(intervals, Kept::default().intervals);
    bench.storage_done(Ok(()));
    bench.requests.clear();

    bench.message(&SETUP_SIGNING_DATA {
        initial_timestamp: 5 << 16,
        target_system: 1,
        target_component: 1,
        secret_key: [7; 32],
    });
    assert_eq!(bench.keeps_after_ms(), 1_001);
    let kept = bench.esc.kept();
    let signing = kept.signing.expect("there is a key");
    assert_eq!(signing.key, Key([7; 32]));
    // 1 s is 1.5 of its units.
    assert!((5..=7).contains(&signing.newest), "{}", signing.newest);

    // It continues after a restart.
    let loaded = Loaded {
        kept: kept.clone(),
        integrity: Integrity::Sound,
        out_of_range: false,
        unknown: false,
    };
    let mut other = Bench::new();
    other.esc.recall(&loaded);
    assert_eq!(other.esc.kept().intervals, intervals);
    assert_eq!(
        other.esc.kept().signing.map(|signing| signing.key),
        Some(Key([7; 32]))
    );
}

#[test]
fn a_failure_is_told_once() {
    let mut bench = rested();
    for (value, result, texts) in [
        (12.0, Err("storage: the flash failed"), 1),
        (13.0, Err("storage: the flash failed"), 0),
        (14.0, Ok(()), 0),
        (15.0, Err("storage: the flash failed"), 1),
    ] {
        bench.set("LIM_PHASE_A", value);
        bench.keeps_after_ms();
        bench.storage_done(result);
        bench.wait_ms(2_000);
        assert_eq!(bench.texts.len(), texts, "{value}: {:?}", bench.texts);
        assert_eq!(
            bench.requests,
            [Request::ParamsChanged, Request::Keep],
            "no more"
        );
        bench.requests.clear();
        bench.texts.clear();
    }
}

#[test]
fn a_restart_stores_first_what_waits() {
    let mut bench = rested();
    bench.set("LIM_PHASE_A", 12.5);
    bench.command(REBOOT, 1.0);
    bench.wait_ms(5);
    assert_eq!(bench.requests, [Request::ParamsChanged, Request::Keep]);
    assert_eq!(bench.results, [ACCEPTED]);
    bench.wait_ms(50);
    assert_eq!(bench.requests.len(), 2, "it is being stored");
    bench.storage_done(Ok(()));
    assert_eq!(bench.requests[2..], [Request::Reboot]);
}

#[test]
fn a_restart_without_anything_to_store_is_made_at_once() {
    let mut bench = rested();
    bench.command(REBOOT, 1.0);
    bench.wait_ms(2);
    assert_eq!(bench.requests, [Request::Reboot]);
}

#[test]
fn an_armed_wire_refuses_a_restart() {
    let mut bench = Bench::armed();
    bench.command(REBOOT, 1.0);
    bench.frames(2_000, 0);
    assert_eq!(bench.results, [REJECTED]);
    assert_eq!(bench.texts, ["No reboot: armed"]);
    assert_eq!(bench.requests, []);
    // With the motor disarmed, it may, even before the wire holds zero again.
    bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, 0.0);
    bench.command(REBOOT, 1.0);
    bench.wait_ms(2);
    assert_eq!(bench.results, [REJECTED, ACCEPTED, ACCEPTED]);
    assert_eq!(bench.requests, [Request::Reboot]);
}

/// All unrequested saves are used up, and a change and a restart call for one.
fn restart_that_waits() -> Bench {
    let mut bench = Bench::new();
    let mut loaded = loaded(Integrity::Sound);
    loaded.kept.owed_s = 100 * 180;
    bench.esc.recall(&loaded);
    bench.wait_ms(3_000);
    bench.texts.clear();
    bench.set("LIM_PHASE_A", 12.5);
    bench.command(REBOOT, 1.0);
    bench.wait_ms(50);
    assert_eq!(bench.results, [ACCEPTED]);
    assert_eq!(bench.requests, [Request::ParamsChanged]);
    bench
}

/// It takes minutes when the flash is being spared: nobody should think that the command was lost.
#[test]
fn a_restart_that_waits_says_so() {
    let mut bench = restart_that_waits();
    let waits = "Reboot waits up to 3 min for the next save";
    assert_eq!(bench.texts, ["Rebooting", waits]);
    bench.wait_ms(60_000);
    bench.storage_done(Ok(()));
    assert_eq!(bench.requests[2..], [Request::Reboot]);
    assert_eq!(bench.texts.len(), 2, "once");
    // One whose save comes at once does not.
    let mut bench = rested();
    bench.set("LIM_PHASE_A", 12.5);
    bench.command(REBOOT, 1.0);
    bench.wait_ms(5);
    assert_eq!(bench.texts, ["Rebooting"]);
}

#[test]
fn a_restart_that_waits_is_given_up_when_the_wire_is_armed_or_the_motor_turns() {
    for (acts, text) in [
        (
            (|bench| bench.frames(400, 0)) as fn(&mut Bench),
            "No reboot: armed",
        ),
        (
            |bench| bench.command(MavCmd::MAV_CMD_ACTUATOR_TEST, 0.1),
            "No reboot: the motor turns",
        ),
    ] {
        let mut bench = restart_that_waits();
        acts(&mut bench);
        bench.wait_ms(2);
        let told = bench.texts.iter().filter(|told| *told == text).count();
        assert_eq!(told, 1, "{:?}", bench.texts);
        bench.wait_ms(60_000);
        bench.storage_done(Ok(()));
        bench.wait_ms(100);
        let requests = [Request::ParamsChanged, Request::Keep];
        assert_eq!(bench.requests, requests, "no restart");
    }
}

#[test]
fn statistics_are_kept_when_the_motor_has_come_to_rest() {
    let mut bench = Bench::armed();
    let mut faults = Faults::NONE;
    for phase in [Phase::Park, Phase::Ramp, Phase::Run] {
        bench.snapshot.phase = phase;
        bench.frames(1_000, 1_000);
    }
    faults.insert(Fault::UnderVoltage);
    bench.snapshot.faults = faults;
    bench.snapshot.phase = Phase::Idle;
    bench.frames(900, 0);
    assert_eq!(
        bench.requests,
        [],
        "neither in flight nor before a quiet second"
    );
    bench.frames(200, 0);
    assert_eq!(bench.requests, [Request::Keep]);
    let statistics = bench.esc.kept().statistics;
    assert_eq!((statistics.run_s, statistics.starts), (3, 1));
    assert_eq!(statistics.faults, [0, 0, 1, 0, 0, 0, 0, 0]);
    assert_eq!(statistics.temperature_max_c, 25.0);
    bench.storage_done(Ok(()));
    bench.frames(5_000, 0);
    assert_eq!(bench.requests.len(), 1, "not more often");
}

#[test]
fn what_the_wire_has_set_waits_for_the_wire() {
    let mut bench = Bench::armed();
    bench.frames(10, 8);
    assert_eq!(bench.get(ParamId::MotDir), 1.0);
    bench.frames(5_000, 0);
    assert_eq!(
        bench.requests,
        [Request::ParamsChanged],
        "not stored by itself"
    );
    assert_eq!(bench.esc.kept().params.get(ParamId::MotDir), 0.0);
    // Nor with one that is.
    bench.set("LIM_PHASE_A", 12.5);
    bench.frames(1_100, 0);
    assert_eq!(bench.requests[1..], [Request::ParamsChanged, Request::Keep]);
    let kept = bench.esc.kept().params;
    assert_eq!(
        (kept.get(ParamId::MotDir), kept.get(ParamId::LimPhaseA)),
        (0.0, 12.5)
    );
    bench.storage_done(Ok(()));

    bench.frames(10, 12);
    assert_eq!(bench.requests[3..], [Request::Save]);
    assert_eq!(bench.esc.kept().params.get(ParamId::MotDir), 1.0);
    bench.storage_done(Ok(()));
    assert_eq!(
        bench.esc.kept().params.get(ParamId::MotDir),
        1.0,
        "from now on"
    );
}

#[test]
fn a_value_set_by_mavlink_is_not_the_wires_any_more() {
    let mut bench = Bench::armed();
    bench.frames(10, 8);
    bench.set("MOT_DIR", 0.0);
    bench.frames(10, 8);
    assert_eq!(bench.esc.kept().params.get(ParamId::MotDir), 0.0);
    bench.frames(10, 7);
    assert_eq!(bench.esc.kept().params.get(ParamId::MotDir), 0.0);
    bench.set("MOT_DIR", 1.0);
    assert_eq!(bench.esc.kept().params.get(ParamId::MotDir), 1.0);
}

#[test]
fn a_reset_to_the_factorys_settings_leaves_the_statistics_alone() {
    let mut bench = rested();
    let statistics = Statistics {
        run_s: 77,
        temperature_max_c: 61.0,
        ..Statistics::NONE
    };
    bench.esc.recall(&Loaded {
        kept: Kept {
            statistics,
            signing: Some(KeptSigning {
                key: Key([7; 32]),
                newest: 0,
            }),
            ..Kept::default()
        },
        integrity: Integrity::Sound,
        out_of_range: false,
        unknown: true,
    });
    bench.wait_ms(1);
    let warning = "storage: values of another firmware are kept";
    assert_eq!(bench.texts, [warning]);
    bench.command(STORAGE, 2.0);
    bench.wait_ms(1);
    assert_eq!(bench.requests, [], "it is not signed");
    let mut reset = Kept {
        statistics,
        ..Kept::default()
    };
    bench.esc.replace(&mut reset);
    assert_eq!(bench.esc.kept(), reset);
    bench.wait_ms(1);
    assert_eq!(bench.esc.kept(), reset, "the key is gone with the replies");
    bench.command(STORAGE, 2.0);
    bench.wait_ms(1);
    let requests = [Request::ParamsChanged, Request::FactoryReset];
    assert_eq!(bench.requests, requests);
}

fn loaded(integrity: Integrity) -> Loaded {
    Loaded {
        kept: Kept::default(),
        integrity,
        out_of_range: false,
        unknown: false,
    }
}

/// The defaults may suit another motor.
#[test]
fn where_settings_were_lost_nothing_turns_the_motor_until_some_are_stored() {
    for integrity in [
        Integrity::Unfinished,
        Integrity::Corrupt,
        Integrity::Unreadable,
    ] {
        let mut bench = Bench::new();
        bench.esc.recall(&loaded(integrity));
        bench.frames(12_000, 0);
        assert!(!bench.esc.telemetry().armed, "{integrity:?}");
        let lost = "Settings lost: set and store, or reset";
        let told = |text: &&String| text.as_str() == lost;
        assert_eq!(bench.texts.iter().filter(told).count(), 1);
        assert!(bench.texts[0].starts_with("storage: "), "{:?}", bench.texts);
        bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, 1.0);
        bench.command(MavCmd::MAV_CMD_ACTUATOR_TEST, 0.1);
        bench.wait_ms(1);
        let rejected = MavResult::MAV_RESULT_TEMPORARILY_REJECTED;
        assert_eq!(bench.results, [MavResult::MAV_RESULT_DENIED, rejected]);
        bench.frames(10, 1_000);
        assert_eq!(bench.throttle.setpoint(), Setpoint::Stop);

        // What a station or a companion sets unasked restores nothing, nor does what a stick teaches.
        bench.message(&COMMAND_LONG_DATA {
            param1: 291.0,
            param2: 20_000.0,
            command: INTERVAL,
            target_system: 1,
            target_component: 1,
            ..COMMAND_LONG_DATA::default()
        });
        bench.set("TEL_RATE_HZ", 20.0);
        let ends = News::Calibration(Step::Done(EndPoints {
            min_us: 1_100,
            max_us: 1_900,
        }));
        bench.esc.hear(bench.now_us, ends);
        bench.frames(5_000, 0);
        assert_eq!(bench.requests, [Request::ParamsChanged]);
        assert!(!bench.esc.telemetry().armed, "{integrity:?}");
        bench.requests.clear();
        for result in [Err("storage: the flash failed"), Ok(())] {
            bench.set("LIM_PHASE_A", 12.5);
            bench.command(STORAGE, 1.0);
            bench.frames(2_000, 0);
            assert_eq!(bench.requests, [Request::ParamsChanged, Request::Save]);
            assert!(!bench.esc.telemetry().armed, "{integrity:?}");
            bench.requests.clear();
            bench.storage_done(result);
            bench.frames(1_000, 0);
            assert_eq!(bench.esc.telemetry().armed, result.is_ok());
        }
    }
}

#[test]
fn where_nothing_was_lost_the_wire_arms() {
    for integrity in [Integrity::Sound, Integrity::Empty, Integrity::Incomplete] {
        let mut bench = Bench::new();
        bench.esc.recall(&loaded(integrity));
        bench.frames(1_000, 0);
        assert!(bench.esc.telemetry().armed, "{integrity:?}");
    }
}

#[test]
fn what_is_asked_for_stores_settings_that_were_lost() {
    for (action, request) in [(1.0, Request::Save), (2.0, Request::FactoryReset)] {
        let mut bench = Bench::new();
        bench.esc.recall(&loaded(Integrity::Corrupt));
        bench.frames(2_000, 0);
        bench.command(STORAGE, action);
        bench.frames(10, 0);
        assert_eq!(bench.requests, [request]);
        bench.storage_done(Ok(()));
        bench.frames(1_000, 0);
        assert!(bench.esc.telemetry().armed);
    }
}

#[test]
fn a_failed_save_that_nobody_asked_for_ends_no_calibration() {
    let mut bench = rested();
    bench.set("LIM_PHASE_A", 12.5);
    bench.message(&COMMAND_LONG_DATA {
        param7: 1.0,
        command: MavCmd::MAV_CMD_PREFLIGHT_CALIBRATION,
        target_system: 1,
        target_component: 1,
        ..COMMAND_LONG_DATA::default()
    });
    bench.keeps_after_ms();
    let results = bench.results.clone();
    bench.storage_done(Err("storage: the flash failed"));
    bench.wait_ms(5);
    assert_eq!(bench.results, results);
}

#[test]
fn what_the_wire_has_set_is_not_stored_by_itself_after_its_own_save_has_failed() {
    let mut bench = Bench::armed();
    bench.frames(10, 8);
    bench.frames(10, 12);
    assert_eq!(bench.requests, [Request::ParamsChanged, Request::Save]);
    assert_eq!(bench.esc.kept().params.get(ParamId::MotDir), 1.0);
    bench.storage_done(Err("storage: the flash failed"));
    assert_eq!(bench.esc.kept().params.get(ParamId::MotDir), 0.0);
}

#[test]
fn pole_pairs_that_are_not_known_are_told_at_the_start() {
    for (pole_pairs, told) in [(0.0, true), (7.0, false)] {
        let mut bench = Bench::new();
        bench.set("MOT_POLE_PAIRS", pole_pairs);
        bench.esc.recall(&loaded(Integrity::Sound));
        bench.wait_ms(5);
        let tells = |text: &String| text.starts_with("MOT_POLE_PAIRS unknown");
        assert_eq!(bench.texts.iter().any(tells), told, "{:?}", bench.texts);
    }
}
