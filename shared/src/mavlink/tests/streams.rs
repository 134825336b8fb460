use mavlink::dialects::ardupilotmega::{
    HEARTBEAT_DATA, MISSION_REQUEST_LIST_DATA, MavAutopilot, MavModeFlag, MavSeverity, MavState,
    MavType,
};

use std::borrow::ToOwned;

use siskin_throttle::News;
use siskin_throttle::authority::DriveStatus;
use siskin_throttle::calibration::Step;
use siskin_throttle::signal::{Pulse, Signal};

use super::*;
use crate::drive::Fault;

pub(super) const HEARTBEAT: u32 = 0;
pub(super) const ESC_INFO: u32 = 290;
pub(super) const ESC_STATUS: u32 = 291;
const ESC_TELEMETRY: u32 = 11_030;

fn peripheral() -> Params {
    let mut params = Params::default();
    params.set(ParamId::MavRole, 1.0).expect("in range");
    params.set(ParamId::MavSysId, 5.0).expect("in range");
    params.set(ParamId::MavCompId, 142.0).expect("in range");
    params
}

#[test]
fn each_message_has_its_rate_and_frames_are_numbered() {
    let mut bench = Bench::new();
    let sent = bench.run_ms(10_000);
    assert_eq!(count(&sent, HEARTBEAT), 10);
    assert_eq!(count(&sent, ESC_INFO), 10);
    assert_eq!(count(&sent, ESC_STATUS), 100);
    assert_eq!(count(&sent, ESC_TELEMETRY), 100);
    for pair in sent.windows(2) {
        assert_eq!(pair[1].sequence, pair[0].sequence.wrapping_add(1));
        assert_eq!(pair[1].from, ESC);
    }

    bench
        .params
        .set(ParamId::TelRateHz, 50.0)
        .expect("in range");
    let sent = bench.run_ms(2000);
    // The new interval counts from the change, 1 ms after the start here.
    assert_eq!(count(&sent, ESC_STATUS), 99);
    assert_eq!(count(&sent, HEARTBEAT), 2);
}

#[test]
fn a_slow_link_is_shared_and_the_heartbeat_stays() {
    let mut params = Params::default();
    params.set(ParamId::TelRateHz, 100.0).expect("in range");
    let mut bench = Bench::with(params, 5000);
    let sent = bench.run_ms(10_000);
    let bytes: usize = sent.iter().map(|sent| sent.len).sum();
    assert!(bytes <= 25_000 + 480 + 21 * 10, "{bytes} bytes in 10 s");
    assert_eq!(count(&sent, HEARTBEAT), 10);
    // It takes its turn, some milliseconds late: the tenth may fall outside.
    assert!((9..=10).contains(&count(&sent, ESC_INFO)));
    let (status, telemetry) = (count(&sent, ESC_STATUS), count(&sent, ESC_TELEMETRY));
    assert!(
        status > 150 && status.abs_diff(telemetry) <= 2,
        "{status} and {telemetry}"
    );
}

#[test]
fn the_values_arrive_in_the_units_of_the_messages() {
    let mut bench = Bench::new();
    bench.telemetry = Telemetry {
        rpm: -2999.6,
        bus_v: 23.456,
        bus_a: 4.321,
        consumed_mah: 12.6,
        temperature_c: 41.27,
        phase: Phase::Run,
        fault_count: 3,
        bad_frames: 4,
        bad_share: 0.125,
        ..TELEMETRY
    };
    let mut seen = 0;
    for sent in bench.run_ms(1000) {
        seen += 1;
        match sent.message {
            MavMessage::ESC_INFO(info) => {
                assert_eq!(info.temperature, [4127, i16::MAX, i16::MAX, i16::MAX]);
                assert_eq!((info.index, info.count, info.info), (0, 1, 1));
                assert_eq!(info.error_count, [7, 0, 0, 0]);
                assert_eq!(info.failure_flags, [0; 4]);
                assert_eq!(info.connection_type as u8, 5);
            }
            MavMessage::ESC_STATUS(status) => {
                assert_eq!(status.rpm, [-3000, 0, 0, 0]);
                assert_eq!(status.voltage[0], 23.456);
                assert_eq!(status.current[0], 4.321);
                assert_eq!(status.time_usec, sent.at_us);
            }
            MavMessage::ESC_TELEMETRY_1_TO_4(telemetry) => {
                assert_eq!(telemetry.rpm[0], 3000);
                assert_eq!(telemetry.voltage[0], 2346);
                assert_eq!(telemetry.current[0], 432);
                assert_eq!(telemetry.totalcurrent[0], 13);
                assert_eq!(telemetry.temperature, [41, 0, 0, 0]);
            }
            MavMessage::HEARTBEAT(beat) => {
                assert_eq!(beat.mavtype, MavType::MAV_TYPE_GENERIC);
                assert_eq!(beat.autopilot, MavAutopilot::MAV_AUTOPILOT_GENERIC);
                assert_eq!(beat.system_status, MavState::MAV_STATE_ACTIVE);
                assert_eq!(beat.mavlink_version, 3);
            }
            MavMessage::NAMED_VALUE_FLOAT(value) => {
                assert_eq!(value.name.to_str().expect("ASCII"), "bad_frames");
                assert_eq!(value.value, 12.5);
                assert_eq!(u64::from(value.time_boot_ms), sent.at_us / 1000);
            }
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(seen, 23);
}

fn beat(bench: &mut Bench) -> HEARTBEAT_DATA {
    let sent = bench.run_ms(1000);
    sent.iter()
        .find_map(|sent| match &sent.message {
            MavMessage::HEARTBEAT(beat) => Some(beat.clone()),
            _ => None,
        })
        .expect("one a second")
}

#[test]
fn the_heartbeat_tells_the_state() {
    let mut bench = Bench::new();
    let idle = beat(&mut bench);
    assert_eq!(idle.system_status, MavState::MAV_STATE_STANDBY);
    assert_eq!(idle.base_mode, MavModeFlag::empty());
    bench.telemetry.faults.insert(Fault::OverCurrent);
    assert_eq!(beat(&mut bench).system_status, MavState::MAV_STATE_CRITICAL);
}

#[test]
fn a_fault_is_told_when_it_appears_and_when_it_ends() {
    let mut bench = Bench::new();
    bench.telemetry.faults.insert(Fault::OverCurrent);
    let sent = bench.answers();
    assert_eq!(texts(&sent), ["Fault: over-current"]);
    assert_eq!(bench.answers().len(), 0);
    bench.telemetry.faults.insert(Fault::OverTemperature);
    assert_eq!(texts(&bench.answers()), ["Fault: over-temperature"]);
    bench.telemetry.faults = Faults::NONE;
    let ended = ["Fault ended: over-current", "Fault ended: over-temperature"];
    assert_eq!(texts(&bench.answers()), ended);
}

#[test]
fn every_fault_is_told_in_words_and_by_its_flag_and_so_is_its_end() {
    let mut bench = Bench::new();
    bench.run_ms(10);
    for fault in Fault::ALL {
        for (present, severity, word) in [
            (true, MavSeverity::MAV_SEVERITY_CRITICAL, "Fault: "),
            (false, MavSeverity::MAV_SEVERITY_NOTICE, "Fault ended: "),
        ] {
            bench.telemetry.faults = Faults::NONE;
            if present {
                bench.telemetry.faults.insert(fault);
            }
            let (mut told, mut flags) = (Vec::new(), None);
            for sent in bench.run_ms(1) {
                match sent.message {
                    MavMessage::STATUSTEXT(text) => {
                        told.push((text.severity, text.text.to_str().expect("ASCII").to_owned()));
                    }
                    MavMessage::ESC_INFO(info) => flags = Some(info.failure_flags[0] != 0),
                    _ => {}
                }
            }
            assert_eq!(told, [(severity, word.to_owned() + fault.text())]);
            assert_eq!(flags, Some(present), "{fault:?}");
        }
    }
}

#[test]
fn a_peripheral_follows_the_first_autopilot_it_hears() {
    let mut bench = Bench::with(peripheral(), 100_000);
    let first = beat(&mut bench);
    assert_eq!(first.mavtype, MavType::MAV_TYPE_SERVO);
    assert_eq!(first.autopilot, MavAutopilot::MAV_AUTOPILOT_INVALID);
    assert_eq!(system_of(&mut bench), 5);

    let station = HEARTBEAT_DATA {
        mavtype: MavType::MAV_TYPE_GCS,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        ..HEARTBEAT_DATA::default()
    };
    bench.receive(&encode(
        Address {
            system: 9,
            component: 1,
        },
        &station,
        &[],
    ));
    assert_eq!(system_of(&mut bench), 5);
    for (system, wanted) in [(3, 3), (4, 3)] {
        bench.receive(&autopilot(system));
        assert_eq!(system_of(&mut bench), wanted);
    }
}

#[test]
fn a_peripheral_does_not_join_system_0_which_stands_for_all() {
    let mut bench = Bench::with(peripheral(), 100_000);
    bench.receive(&autopilot(0));
    assert_eq!(system_of(&mut bench), 5);
    bench.receive(&autopilot(3));
    assert_eq!(system_of(&mut bench), 3);
    bench.receive(&autopilot(0));
    assert_eq!(system_of(&mut bench), 3);
}

/// Returns a heartbeat of this system's autopilot.
fn autopilot(system: u8) -> Vec<u8> {
    let from = Address {
        system,
        component: 1,
    };
    let data = HEARTBEAT_DATA {
        mavtype: MavType::MAV_TYPE_QUADROTOR,
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        ..HEARTBEAT_DATA::default()
    };
    encode(from, &data, &[])
}

/// Returns the system that a peripheral with component 142 claims.
fn system_of(bench: &mut Bench) -> u8 {
    let from = bench.run_ms(100)[0].from;
    assert_eq!(from.component, 142);
    from.system
}

#[test]
fn a_peripheral_fills_its_own_slot() {
    // Component, then index, slot, count, bit and the id of the older message.
    for (component, index, slot, count, bit, telemetry_id) in [
        (140_u8, 0, 0, 1, 0b0000_0001, 11_030),
        (142, 0, 2, 3, 0b0000_0100, 11_030),
        (145, 4, 1, 6, 0b0010_0000, 11_031),
        (147, 4, 3, 8, 0b1000_0000, 11_031),
        (149, 8, 1, 10, 0, 11_032),
        (153, 12, 1, 14, 0, 11_040),
        (139, 0, 0, 1, 1, 11_030),
        (154, 0, 0, 1, 1, 11_030),
    ] {
        let mut params = peripheral();
        let id = f32::from(component);
        params.set(ParamId::MavCompId, id).expect("in range");
        let mut bench = Bench::with(params, 1_000_000);
        bench.telemetry = Telemetry {
            rpm: 3000.0,
            bus_v: 24.0,
            bus_a: 2.0,
            fault_count: 5,
            ..TELEMETRY
        };
        bench.telemetry.faults.insert(Fault::OverCurrent);
        let only = |value: f64| {
            let mut slots = [0.0; 4];
            slots[slot] = value;
            slots
        };
        let mut seen = 0;
        for sent in bench.run_ms(1000) {
            match sent.message {
                MavMessage::ESC_INFO(info) => {
                    seen |= 1;
                    assert_eq!((info.index, info.count, info.info), (index, count, bit));
                    assert_eq!(info.error_count.map(f64::from), only(5.0));
                    assert_eq!(info.failure_flags.map(f64::from), only(1.0));
                    let mut temperature = [i16::MAX; 4];
                    temperature[slot] = 2500;
                    assert_eq!(info.temperature, temperature);
                }
                MavMessage::ESC_STATUS(status) => {
                    seen |= 2;
                    assert_eq!(status.index, index);
                    assert_eq!(status.rpm.map(f64::from), only(3000.0));
                    assert_eq!(status.voltage.map(f64::from), only(24.0));
                    assert_eq!(status.current.map(f64::from), only(2.0));
                }
                other if other.message_id() == telemetry_id => {
                    seen |= 4;
                    let at = |i: usize| u16::from_le_bytes([sent.payload[i], sent.payload[i + 1]]);
                    let rpm = [24, 26, 28, 30].map(|i| f64::from(at(i)));
                    assert_eq!(rpm, only(3000.0), "component {component}");
                }
                MavMessage::NAMED_VALUE_FLOAT(_) => seen |= 8,
                MavMessage::HEARTBEAT(_) | MavMessage::STATUSTEXT(_) => {}
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(seen, 15, "component {component}");
    }
}

#[test]
fn a_change_of_faults_is_in_esc_info_at_once() {
    let mut bench = Bench::new();
    bench.run_ms(1500);
    for present in [true, false] {
        bench.telemetry.faults = Faults::NONE;
        if present {
            bench.telemetry.faults.insert(Fault::OverVoltage);
        }
        let sent = bench.run_ms(1);
        let flags = sent.iter().find_map(|sent| match &sent.message {
            MavMessage::ESC_INFO(info) => Some(info.failure_flags[0]),
            _ => None,
        });
        assert_eq!(flags.map(|flags| flags != 0), Some(present));
    }
    // And then every second as before.
    assert_eq!(count(&bench.run_ms(999), ESC_INFO), 0);
    assert_eq!(count(&bench.run_ms(1), ESC_INFO), 1);
}

#[test]
fn a_fault_that_comes_and_goes_is_told_once_a_second() {
    let mut bench = Bench::new();
    let mut told = Vec::new();
    for ms in 0..3000 {
        bench.telemetry.faults = Faults::NONE;
        if ms % 2 == 0 {
            bench.telemetry.faults.insert(Fault::OverCurrent);
        }
        let sent = bench.run_ms(1);
        told.extend(texts(&sent).iter().map(|text| (ms, (*text).len())));
    }
    let (began, ended) = (
        "Fault: over-current".len(),
        "Fault ended: over-current".len(),
    );
    let expected = [0, 1, 1000, 1001, 2000, 2001];
    let lengths = [began, ended].repeat(3);
    assert_eq!(told, expected.into_iter().zip(lengths).collect::<Vec<_>>());
    // The last state is reported, however soon it came.
    bench.telemetry.faults.insert(Fault::OverCurrent);
    assert_eq!(texts(&bench.run_ms(1)).len(), 1);
    bench.telemetry.faults = Faults::NONE;
    bench.run_ms(1);
    bench.telemetry.faults.insert(Fault::OverCurrent);
    let late = bench.run_ms(1100);
    assert_eq!(texts(&late).last(), Some(&"Fault: over-current"));
}

#[test]
fn only_a_vehicle_has_missions_and_it_has_none() {
    let request = MISSION_REQUEST_LIST_DATA {
        target_system: 0,
        target_component: 0,
    };
    let mut bench = Bench::new();
    bench.receive(&encode(STATION, &request, &[2]));
    let sent = bench.answers();
    let MavMessage::MISSION_COUNT(missions) = &sent[0].message else {
        panic!("{sent:?}");
    };
    assert_eq!(
        (
            missions.count,
            missions.target_system,
            missions.target_component
        ),
        (0, 255, 190)
    );
    // The requested type: rally points.
    assert_eq!(sent[0].payload[4], 2);

    let mut bench = Bench::with(peripheral(), 100_000);
    bench.receive(&encode(STATION, &request, &[]));
    assert_eq!(bench.answers().len(), 0);
}

#[test]
fn a_running_test_shows_as_turning() {
    let mut bench = Bench::new();
    let at_rest = DriveStatus {
        stopped: true,
        faulted: false,
    };
    let now_us = bench.now_us;
    bench
        .authority
        .actuator_test(now_us, 0.1, 1.0, at_rest)
        .expect("the wire is silent");
    bench.telemetry.phase = Phase::Park;
    assert_eq!(beat(&mut bench).system_status, MavState::MAV_STATE_ACTIVE);
}

#[test]
fn the_type_of_connection_follows_the_signal() {
    let mut bench = Bench::new();
    for signal in Signal::all().map(Some).chain([None]) {
        bench.telemetry.signal = signal;
        let wanted = match signal {
            Some(Signal::Pulse(Pulse::Servo)) => 0,
            Some(Signal::Pulse(_)) => 2,
            Some(Signal::Dshot { .. }) | None => 5,
        };
        let sent = bench.run_ms(1000);
        let found = sent.iter().filter_map(|sent| match &sent.message {
            MavMessage::ESC_INFO(info) => Some(info.connection_type as u8),
            _ => None,
        });
        let found: Vec<_> = found.collect();
        assert_eq!(found, [wanted], "{signal:?}");
    }
}

#[test]
fn what_the_wire_tells_is_told_in_words() {
    let mut bench = Bench::new();
    let bidirectional = Signal::from_number(22).expect("it is one");
    for (news, words) in [
        (
            News::Identified(bidirectional),
            &["Throttle: bidirectional DShot600"][..],
        ),
        (News::Unknown, &["Throttle: unknown signal"]),
        (News::OpenThrottle, &["Throttle is open: lower it to arm"]),
        (
            News::Lost { armed: true },
            &["Throttle: signal lost while armed"],
        ),
        (News::Lost { armed: false }, &["Throttle: signal lost"]),
        (
            News::Calibration(Step::Full),
            &["Stick calibration: full taken, now lower it"],
        ),
        (
            News::Calibration(Step::Cancelled),
            &["Stick calibration: given up"],
        ),
        (News::Armed, &[]),
    ] {
        bench.component.report_news(news);
        assert_eq!(texts(&bench.answers()), words);
    }
}

#[test]
fn what_something_else_has_changed_is_broadcast_and_put_in_force() {
    let mut bench = Bench::new();
    bench.params.set(ParamId::MotDir, 1.0).expect("in range");
    bench.component.changed(&[ParamId::MotDir]);
    let sent = bench.answers();
    assert_eq!(values(&sent), [(ParamId::MotDir as u16, 1.0)]);
    assert_eq!(bench.component.take_request(), Some(Request::ParamsChanged));
    assert_eq!(bench.component.take_request(), None);
}
