//! Storage by throttle wire and MAVLink: it waits for the bridge to rest, one request at a time.

use siskin_throttle::authority::Command;

use super::*;
use crate::mavlink::Receiver;
use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd, MavResult, PARAM_SET_DATA};
use mavlink::types::CharArray;
use mavlink::{MAVLinkV2MessageRaw, MavHeader};

pub(super) const STORAGE: MavCmd = MavCmd::MAV_CMD_PREFLIGHT_STORAGE;
pub(super) const REBOOT: MavCmd = MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN;
const ACTUATOR_TEST: MavCmd = MavCmd::MAV_CMD_ACTUATOR_TEST;

pub(super) const ACCEPTED: MavResult = MavResult::MAV_RESULT_ACCEPTED;
pub(super) const REJECTED: MavResult = MavResult::MAV_RESULT_TEMPORARILY_REJECTED;

impl Bench {
    /// Sends a message from a ground station.
    pub(super) fn message<D: MessageData>(&mut self, data: &D) {
        let mut raw = MAVLinkV2MessageRaw::new();
        let header = MavHeader {
            system_id: 255,
            component_id: 190,
            sequence: 0,
        };
        raw.serialize_message_data(header, data);
        let Self {
            esc,
            throttle,
            now_us,
            ..
        } = self;
        let now_us = *now_us;
        Receiver::new().push(now_us, raw.raw_bytes(), |frame| {
            esc.receive(throttle, now_us, frame);
        });
    }

    pub(super) fn command(&mut self, command: MavCmd, param1: f32) {
        self.message(&COMMAND_LONG_DATA {
            param1,
            param2: 1.0,
            param5: 1.0,
            command,
            target_system: 1,
            target_component: 1,
            ..COMMAND_LONG_DATA::default()
        });
    }

    fn set_phase(&mut self, phase: Phase) {
        self.snapshot.phase = phase;
        self.wait_ms(1);
    }
}

#[test]
fn a_save_that_waited_for_a_tune_is_not_made_in_flight() {
    let mut bench = Bench::armed();
    bench.frames(1, 1);
    bench.frames(10, 12);
    bench.frames(100, 1000);
    assert_eq!(bench.requests, [], "the motor starts");
    bench.snapshot.phase = Phase::Run;
    bench.frames(100, 1000);
    bench.frames(10, 0);
    assert_eq!(bench.requests, [], "it still turns");
    bench.snapshot.phase = Phase::Idle;
    bench.frames(985, 0);
    assert_eq!(bench.requests, [], "not a second yet");
    bench.frames(15, 0);
    assert_eq!(bench.requests, [Request::Save]);
}

#[test]
fn a_silent_wire_is_not_waited_for() {
    let mut bench = Bench::armed();
    bench.frames(4, 1000);
    bench.frames(10, 0);
    bench.command(STORAGE, 1.0);
    bench.wait_ms(95);
    assert_eq!(bench.requests, [], "the signal may come back");
    // The tune for the loss is over, and less than a second has passed.
    bench.wait_ms(800);
    assert_eq!(bench.requests, [Request::Save]);
}

#[test]
fn nothing_turns_the_motor_while_the_flash_is_written() {
    let mut bench = Bench::armed();
    bench.frames(10, 12);
    assert_eq!(bench.requests, [Request::Save]);
    bench.frames(5, 1000);
    assert_eq!(bench.throttle.setpoint(), Setpoint::Stop);
    bench.storage_done(Ok(()));
    assert!(matches!(bench.throttle.setpoint(), Setpoint::Speed(_)));
}

#[test]
fn a_start_is_no_rest_in_any_of_its_phases() {
    for phase in [Phase::Idle, Phase::Sense, Phase::Charge, Phase::Park] {
        let mut bench = Bench::armed();
        bench.frames(4, 1000);
        bench.set_phase(phase);
        for action in [0.0, 1.0, 2.0] {
            bench.command(STORAGE, action);
        }
        bench.command(REBOOT, 1.0);
        bench.command(ACTUATOR_TEST, 0.1);
        bench.message(&PARAM_SET_DATA {
            param_value: 1.0,
            target_system: 1,
            target_component: 1,
            param_id: CharArray::new(*b"MOT_DIR\0\0\0\0\0\0\0\0\0"),
            ..PARAM_SET_DATA::default()
        });
        bench.wait_ms(1);
        assert_eq!(bench.requests, [], "{phase:?}");
        assert_eq!(bench.results, [REJECTED; 5], "{phase:?}");
        assert_eq!(bench.get(ParamId::MotDir), 0.0);
        let command = bench.throttle.command();
        assert!(matches!(command, Command::Throttle(_)));
    }
}

#[test]
fn a_second_test_is_refused_before_the_first_has_turned_the_motor() {
    let mut bench = Bench::new();
    bench.wait_ms(300);
    for result in [ACCEPTED, REJECTED] {
        bench.command(ACTUATOR_TEST, 0.1);
        bench.wait_ms(1);
        assert_eq!(bench.results.last(), Some(&result));
    }
}

#[test]
fn storage_by_mavlink_waits_with_its_acknowledgement_until_the_bridge_rests() {
    for (action, request) in [
        (0.0, Request::Load),
        (1.0, Request::Save),
        (2.0, Request::FactoryReset),
    ] {
        // The tune is over, but the drive has not ended it yet.
        let mut bench = Bench::armed();
        bench.frames(1, 1);
        bench.command(STORAGE, action);
        bench.frames(10, 0);
        assert_eq!(bench.requests, [], "a note is due");
        bench.snapshot.phase = Phase::Tone;
        bench.frames(300, 0);
        assert_eq!(bench.esc.tunes.note(), None);
        for phase in [Phase::Tone, Phase::Sense, Phase::Charge] {
            bench.set_phase(phase);
            assert_eq!(bench.requests, [], "{phase:?}");
        }
        assert_eq!(bench.results, [], "not done");
        bench.set_phase(Phase::Brake);
        assert_eq!(bench.requests, [request]);
        bench.storage_done(Ok(()));
        assert_eq!(bench.results, [ACCEPTED]);
    }
}

#[test]
fn one_is_done_at_a_time_and_each_end_is_told_to_who_asked() {
    let mut bench = Bench::armed();
    bench.command(STORAGE, 1.0);
    bench.frames(10, 12);
    assert_eq!(bench.requests, [Request::Save]);
    bench.storage_done(Err("storage: MAVLink"));
    assert_eq!(bench.results, [MavResult::MAV_RESULT_FAILED]);
    assert_eq!(bench.texts, ["storage: MAVLink"]);
    assert_eq!(bench.requests, [Request::Save; 2], "the wire's");
    bench.command(STORAGE, 1.0);
    bench.frames(10, 0);
    assert_eq!(bench.requests.len(), 2);
    bench.storage_done(Ok(()));
    assert_eq!(
        bench.texts.last().map(String::as_str),
        Some("Parameters stored")
    );
    assert_eq!(bench.results.len(), 1);
    assert_eq!(bench.requests, [Request::Save; 3]);
    bench.storage_done(Ok(()));
    assert_eq!(bench.results.last(), Some(&ACCEPTED));
}
