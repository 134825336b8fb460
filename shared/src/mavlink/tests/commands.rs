use mavlink::dialects::ardupilotmega::{
    COMMAND_ACK_DATA, COMMAND_LONG_DATA, MavProtocolCapability, MavResult,
};
use siskin_throttle::authority::Command;

use super::*;
use crate::drive::Fault;

mod calibration;
mod check;
mod motor;
mod storage;

const LONG: (u32, u8) = (COMMAND_LONG_DATA::ID, COMMAND_LONG_DATA::EXTRA_CRC);

const ACCEPTED: MavResult = MavResult::MAV_RESULT_ACCEPTED;
const DENIED: MavResult = MavResult::MAV_RESULT_DENIED;
const FAILED: MavResult = MavResult::MAV_RESULT_FAILED;
const REJECTED: MavResult = MavResult::MAV_RESULT_TEMPORARILY_REJECTED;
const UNSUPPORTED: MavResult = MavResult::MAV_RESULT_UNSUPPORTED;

/// Encodes a COMMAND_LONG as bytes, so that the command can be any number.
fn long(to: Address, command: u16, params: &[f32], confirmation: u8) -> Vec<u8> {
    let mut payload = Vec::new();
    for i in 0..7 {
        let param = params.get(i).copied().unwrap_or(0.0);
        payload.extend_from_slice(&param.to_le_bytes());
    }
    payload.extend_from_slice(&command.to_le_bytes());
    payload.extend_from_slice(&[to.system, to.component, confirmation]);
    frame(STATION, LONG, 0, &payload)
}

/// Returns command and result of each COMMAND_ACK. Its other fields are checked here: the generated
/// type lacks them, and cannot represent a command that the dialect does not know.
fn acks(sent: &[Sent]) -> Vec<(u16, u8)> {
    sent.iter()
        .filter(|sent| sent.message.message_id() == COMMAND_ACK_DATA::ID)
        .map(|sent| {
            assert_eq!(
                sent.payload[8..10],
                [255, 190],
                "to the sender of the command"
            );
            (
                u16::from_le_bytes([sent.payload[0], sent.payload[1]]),
                sent.payload[2],
            )
        })
        .collect()
}

impl Bench {
    pub(super) fn command(&mut self, command: u16, params: &[f32]) -> Vec<Sent> {
        self.receive(&long(ESC, command, params, 0));
        self.answers()
    }

    /// Returns true if a test turns the motor.
    fn tests(&self) -> bool {
        matches!(self.authority.command(), Command::Test(_))
    }

    /// Returns the result of a command that is answered with one ACK.
    fn result(&mut self, command: u16, params: &[f32]) -> u8 {
        let sent = self.command(command, params);
        let acks = acks(&sent);
        assert_eq!(acks.len(), 1, "{acks:?}");
        assert_eq!(acks[0].0, command);
        acks[0].1
    }
}

#[test]
fn an_unknown_command_is_unsupported_and_one_for_others_ignored() {
    let mut bench = Bench::new();
    // TAKEOFF, which the dialect knows, and a number that it does not.
    for command in [22, 64_999] {
        assert_eq!(bench.result(command, &[]), UNSUPPORTED as u8);
    }
    for (system, component, answers) in [(0, 0, 1), (1, 0, 1), (0, 1, 1), (2, 1, 0), (1, 7, 0)] {
        bench.receive(&long(Address { system, component }, 64_999, &[], 0));
        assert_eq!(
            acks(&bench.answers()).len(),
            answers,
            "{system}/{component}"
        );
    }
    // Its own frames come back on some links.
    let mut own = long(ESC, 64_999, &[], 0);
    let end = own.len() - 2;
    own[5..7].copy_from_slice(&[1, 1]);
    let check = calculate_crc(&own[1..end], LONG.1);
    own[end..].copy_from_slice(&check.to_le_bytes());
    bench.receive(&own);
    assert_eq!(bench.answers().len(), 0);
}

/// ESC 5 of a vehicle.
fn peripheral() -> (Bench, Address) {
    let mut params = Params::default();
    for (id, value) in [
        (ParamId::MavRole, 1.0),
        (ParamId::MavSysId, 3.0),
        (ParamId::MavCompId, 145.0),
    ] {
        params.set(id, value).expect("in range");
    }
    let address = Address {
        system: 3,
        component: 145,
    };
    (Bench::with(params, 1_000_000), address)
}

#[test]
fn a_peripheral_is_silent_to_what_all_are_asked_and_it_does_not_know() {
    let (mut bench, own) = peripheral();
    for (system, component, answers) in [(0, 0, 0), (3, 0, 0), (0, 145, 0), (3, 145, 1), (3, 1, 0)]
    {
        bench.receive(&long(Address { system, component }, 22, &[], 0));
        assert_eq!(
            acks(&bench.answers()),
            [(22, UNSUPPORTED as u8)][..answers],
            "{system}/{component}"
        );
    }
    // It obeys known commands from anyone.
    bench.receive(&long(
        Address {
            component: 0,
            ..own
        },
        512,
        &[148.0],
        0,
    ));
    assert_eq!(acks(&bench.answers()), [(512, ACCEPTED as u8)]);
}

#[test]
fn a_test_turns_the_motor_that_it_names() {
    let all = Address {
        system: 0,
        component: 0,
    };
    let (_, own) = peripheral();
    for (to, function, result) in [
        (own, 6.0, ACCEPTED),
        (all, 6.0, ACCEPTED),
        (own, 0.0, ACCEPTED),
        (all, 0.0, DENIED),
        (
            Address {
                component: 0,
                ..own
            },
            0.0,
            DENIED,
        ),
        (Address { system: 0, ..own }, 0.0, DENIED),
        (own, 1.0, DENIED),
        (own, 5.0, DENIED),
        (own, f32::NAN, DENIED),
    ] {
        let (mut bench, _) = peripheral();
        bench.receive(&long(to, 310, &[0.1, 1.0, 0.0, 0.0, function], 0));
        assert_eq!(
            acks(&bench.answers()),
            [(310, result as u8)],
            "{to:?} {function}"
        );
        assert_eq!(bench.tests(), result == ACCEPTED);
    }
}

#[test]
fn an_older_message_is_asked_for_by_the_id_with_its_slot() {
    let (mut bench, own) = peripheral();
    for (id, result) in [(11_031.0, ACCEPTED), (11_030.0, DENIED)] {
        bench.receive(&long(own, 512, &[id], 0));
        assert_eq!(acks(&bench.answers()), [(512, result as u8)]);
    }
    bench.receive(&long(own, 511, &[11_031.0, 10_000.0], 0));
    assert_eq!(acks(&bench.answers()), [(511, ACCEPTED as u8)]);
    assert_eq!(count(&bench.run_ms(1000), 11_031), 100);
}

#[test]
fn a_message_is_sent_on_request() {
    let mut bench = Bench::new();
    for id in [0, 148, 290, 291, 11_030] {
        bench.receive(&long(ESC, 512, &[id as f32], 0));
        let sent = bench.poll();
        assert_eq!(acks(&sent), [(512, ACCEPTED as u8)]);
        assert_eq!(count(&sent, id), 1, "{id}");
    }
    for id in [1.0, 16_777_216.0, -1.0, 0.5, f32::NAN] {
        assert_eq!(bench.result(512, &[id]), DENIED as u8);
    }
    let sent = bench.command(512, &[148.0]);
    let MavMessage::AUTOPILOT_VERSION(version) = &sent[1].message else {
        panic!("{sent:?}");
    };
    let parts: Vec<u32> = env!("CARGO_PKG_VERSION")
        .split('.')
        .map(|p| p.parse().expect("a number"))
        .collect();
    let expected = parts.iter().fold(0, |all, part| all << 8 | part) << 8 | 255;
    assert_eq!(version.flight_sw_version, expected);
    // COMMAND_INT, floats as the value itself, MAVLink 2: what other tests use.
    let served = MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
        | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2
        | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_FTP;
    assert_eq!(version.capabilities, served);
}

fn interval(sent: &[Sent]) -> (u16, i32) {
    sent.iter()
        .find_map(|sent| match &sent.message {
            MavMessage::MESSAGE_INTERVAL(interval) => {
                Some((interval.message_id, interval.interval_us))
            }
            _ => None,
        })
        .expect("MESSAGE_INTERVAL")
}

#[test]
fn intervals_are_set_and_told() {
    let mut bench = Bench::new();
    assert_eq!(interval(&bench.command(510, &[291.0])), (291, 100_000));
    assert_eq!(bench.result(511, &[291.0, 20_000.0]), ACCEPTED as u8);
    assert_eq!(interval(&bench.command(510, &[291.0])), (291, 20_000));
    assert_eq!(
        interval(&bench.command(512, &[244.0, 291.0])),
        (291, 20_000)
    );
    assert_eq!(count(&bench.run_ms(1000), 291), 50);

    assert_eq!(bench.result(511, &[291.0, -1.0]), ACCEPTED as u8);
    assert_eq!(interval(&bench.command(510, &[291.0])), (291, -1));
    assert_eq!(count(&bench.run_ms(1000), 291), 0);

    assert_eq!(bench.result(511, &[291.0, 0.0]), ACCEPTED as u8);
    assert_eq!(count(&bench.run_ms(1000), 291), 10);

    // Not a stream, no interval, and the heartbeat.
    for params in [
        [30.0, 1e5],
        [291.0, -2.0],
        [291.0, f32::NAN],
        [291.0, 1e12],
        [0.0, -1.0],
    ] {
        assert_eq!(bench.result(511, &params), DENIED as u8);
    }
    assert_eq!(interval(&bench.command(510, &[30.0])), (30, 0));
    assert_eq!(bench.result(510, &[70_000.0]), DENIED as u8);
}

#[test]
fn an_actuator_test_turns_the_motor_for_its_time() {
    let mut bench = Bench::new();
    assert_eq!(
        bench.result(310, &[0.1, 1.0, 0.0, 0.0, 1.0]),
        ACCEPTED as u8
    );
    assert!(matches!(bench.authority.command(), Command::Test(_)));
    bench.telemetry.phase = Phase::Run;

    // The ACK was lost: the same command is not obeyed again, and a new one is refused.
    bench.receive(&long(ESC, 310, &[0.1, 1.0, 0.0, 0.0, 1.0], 1));
    assert_eq!(acks(&bench.answers()), [(310, ACCEPTED as u8)]);
    assert_eq!(
        bench.result(310, &[0.1, 1.0, 0.0, 0.0, 1.0]),
        REJECTED as u8
    );
    assert_eq!(bench.result(310, &[f32::NAN]), ACCEPTED as u8);
    assert_eq!(bench.authority.command(), Command::Stop);
}

#[test]
fn a_confirmation_that_does_not_rise_or_comes_late_is_a_new_command() {
    let mut bench = Bench::new();
    let test = |confirmation| long(ESC, 310, &[0.1, 0.5, 0.0, 0.0, 1.0], confirmation);
    for (confirmation, wait_ms) in [(1, 1000), (1, 6000), (2, 0)] {
        bench.receive(&test(confirmation));
        assert_eq!(acks(&bench.answers()), [(310, ACCEPTED as u8)]);
        assert!(matches!(bench.authority.command(), Command::Test(_)));
        bench.run_ms(wait_ms);
        let now_us = bench.now_us;
        bench.authority.poll(now_us);
    }
}

#[test]
fn an_actuator_test_that_cannot_be_is_refused() {
    let mut bench = Bench::new();
    for params in [
        [0.1, 1.0, 0.0, 0.0, 2.0],
        [0.1, 1.0, 0.0, 0.0, f32::NAN],
        [1.5, 1.0, 0.0, 0.0, 1.0],
        [0.1, 4.0, 0.0, 0.0, 1.0],
        [-0.1, 1.0, 0.0, 0.0, 1.0],
    ] {
        assert_eq!(bench.result(310, &params), DENIED as u8, "{params:?}");
    }
    bench.telemetry.rpm = 500.0;
    assert_eq!(
        bench.result(310, &[0.1, 1.0, 0.0, 0.0, 1.0]),
        REJECTED as u8
    );
    assert_eq!(bench.authority.command(), Command::Stop);
}

#[test]
fn a_motor_that_is_to_turn_and_does_not_is_told_every_3_s() {
    let told = |sent: &[Sent]| -> usize {
        let texts = texts(sent);
        texts
            .iter()
            .filter(|text| **text == "Motor does not turn")
            .count()
    };
    let mut bench = Bench::new();
    assert_eq!(told(&bench.run_ms(7_000)), 0, "nothing asks it to");
    assert_eq!(
        bench.result(310, &[0.1, 3.0, 0.0, 0.0, 1.0]),
        ACCEPTED as u8
    );
    assert_eq!(told(&bench.run_ms(2_990)), 0);
    assert_eq!(told(&bench.run_ms(20)), 1);
    assert_eq!(told(&bench.run_ms(2_980)), 0);
    assert_eq!(told(&bench.run_ms(20)), 1);
    // Slow, but it follows.
    (bench.telemetry.phase, bench.telemetry.rpm) = (Phase::Run, -60.0);
    assert_eq!(told(&bench.run_ms(7_000)), 0);
    // Pulled by hand while the drive seeks it.
    (bench.telemetry.phase, bench.telemetry.rpm) = (Phase::Ramp, 500.0);
    assert_eq!(told(&bench.run_ms(3_010)), 1);
    // The fault says why.
    bench.telemetry.faults.insert(Fault::Stuck);
    assert_eq!(told(&bench.run_ms(7_000)), 0);
    bench.telemetry.faults = Faults::NONE;
    bench.authority.disarm();
    assert_eq!(told(&bench.run_ms(7_000)), 0);
}

#[test]
fn arming_needs_the_wire_and_disarming_nothing() {
    let mut bench = Bench::new();
    assert_eq!(bench.result(400, &[1.0]), DENIED as u8);
    assert_eq!(bench.result(400, &[0.0]), ACCEPTED as u8);
    assert_eq!(bench.result(400, &[2.0]), DENIED as u8);
    assert!(!bench.authority.armed());
}

/// Encodes a COMMAND_INT.
fn int(command: u16, [p1, p2]: [f32; 2], p5: i32) -> Vec<u8> {
    let mut payload = [0; 35];
    payload[0..4].copy_from_slice(&p1.to_le_bytes());
    payload[4..8].copy_from_slice(&p2.to_le_bytes());
    payload[16..20].copy_from_slice(&p5.to_le_bytes());
    payload[28..30].copy_from_slice(&command.to_le_bytes());
    payload[30..32].copy_from_slice(&[1, 1]);
    frame(STATION, (75, 158), 0, &payload)
}

#[test]
fn a_command_with_integers_is_obeyed_too() {
    let mut bench = Bench::new();
    bench.receive(&int(310, [0.1, 1.0], 1));
    assert_eq!(acks(&bench.answers()), [(310, ACCEPTED as u8)]);
    assert!(matches!(bench.authority.command(), Command::Test(_)));
}

#[test]
fn a_test_by_integers_sent_again_is_the_same_test() {
    let mut bench = Bench::new();
    let at_rest = bench.telemetry;
    // When it is resent during a test of 2 s, and the result.
    for (wait_ms, second) in [
        (500, ACCEPTED),
        (1000, ACCEPTED),
        (1001, REJECTED),
        // It has ended: the same again is a new one.
        (2500, ACCEPTED),
    ] {
        bench.receive(&int(310, [0.1, 2.0], 1));
        assert_eq!(acks(&bench.answers()), [(310, ACCEPTED as u8)]);
        let started_us = bench.now_us;
        bench.telemetry.phase = Phase::Run;
        bench.run_ms(wait_ms);
        let now_us = bench.now_us;
        bench.authority.poll(now_us);
        if !bench.tests() {
            bench.telemetry = at_rest;
        }
        bench.receive(&int(310, [0.1, 2.0], 1));
        assert_eq!(
            acks(&bench.answers()),
            [(310, second as u8)],
            "{wait_ms} ms"
        );
        assert!(bench.tests());
        // Not restarted: it ends 2 s after its start.
        if wait_ms < 2000 {
            bench.authority.poll(started_us + 1_999_999);
            assert!(bench.tests());
            bench.authority.poll(started_us + 2_000_000);
            assert!(!bench.tests());
        }
        bench.authority.disarm();
        bench.telemetry = at_rest;
        bench.run_ms(2000);
    }
    // Another value is another test, and storing twice is storing twice.
    bench.receive(&int(310, [0.1, 2.0], 1));
    bench.telemetry.phase = Phase::Run;
    bench.receive(&int(310, [0.2, 2.0], 1));
    assert_eq!(
        acks(&bench.answers()),
        [(310, ACCEPTED as u8), (310, REJECTED as u8)]
    );
    bench.authority.disarm();
    bench.telemetry = at_rest;
    for _ in 0..2 {
        bench.receive(&int(245, [1.0, 0.0], 0));
        assert_eq!(bench.component.take_request(), Some(Request::Save));
        bench.component.storage_done(Ok(()));
        assert_eq!(acks(&bench.answers()), [(245, ACCEPTED as u8)]);
    }
}

#[test]
fn one_request_too_many_is_told() {
    let mut bench = Bench::new();
    let flood: Vec<u8> = (0..60).flat_map(|_| long(ESC, 22, &[], 0)).collect();
    bench.receive(&flood);
    let sent = bench.answers();
    assert_eq!(acks(&sent).len(), 40);
    assert_eq!(texts(&sent), ["MAVLink: too many requests"]);
    // 1500 bytes hold 33 commands of 45 bytes: one datagram loses none.
    let datagram: Vec<u8> = (0..33).flat_map(|_| long(ESC, 22, &[], 0)).collect();
    bench.receive(&datagram);
    let sent = bench.answers();
    assert_eq!(acks(&sent).len(), 33);
    assert_eq!(texts(&sent).len(), 0);
}

#[test]
fn a_ping_is_answered_and_an_answer_is_not() {
    let mut bench = Bench::new();
    let mut payload = [0; 14];
    payload[0..8].copy_from_slice(&0x0102_0304_0506_u64.to_le_bytes());
    payload[8..12].copy_from_slice(&77_u32.to_le_bytes());
    bench.receive(&frame(STATION, (4, 237), 0, &payload));
    let sent = bench.answers();
    assert_eq!(sent.len(), 1);
    assert_eq!(sent[0].payload[..12], payload[..12]);
    assert_eq!(sent[0].payload[12..14], [255, 190]);
    payload[12..14].copy_from_slice(&[1, 1]);
    bench.receive(&frame(STATION, (4, 237), 0, &payload));
    assert_eq!(bench.answers().len(), 0);
}
