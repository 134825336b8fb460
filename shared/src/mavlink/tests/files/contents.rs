//! The contents of folders and files, and their places.

use std::string::String;

use mavlink::dialects::ardupilotmega::MavCmd;

use super::*;
use crate::drive::Fault;
use crate::statistics::Statistics;

#[test]
fn folders_are_listed() {
    let mut bench = Bench::new();
    let all = ask(&mut bench, path(LIST, "/"));
    let names = |data: &[u8]| data.split(|byte| *byte == 0).count() - 1;
    assert_eq!((all.offset, names(&all.data)), (0, 4));
    let last = ask(
        &mut bench,
        Ask {
            offset: 3,
            ..path(LIST, "")
        },
    );
    assert_eq!((last.offset, names(&last.data)), (3, 1));
    assert!(all.data.ends_with(&last.data));
}

#[test]
fn faults_are_told_in_words() {
    let mut bench = Bench::new();
    let text =
        |bench: &mut Bench| String::from_utf8(fetch(bench, "@SYS/faults.txt", 239)).expect("ASCII");
    assert_eq!(text(&mut bench), "Faults since the start: 0\n");
    bench.telemetry.faults.insert(Fault::OverCurrent);
    bench.telemetry.faults.insert(Fault::Stuck);
    bench.telemetry.fault_count = 12;
    for warning in ["Restarted after a panic", "Throttle: 3 gaps"] {
        bench.component.warn(warning.try_into().expect("it fits"));
    }
    assert_eq!(
        text(&mut bench),
        "Faults since the start: 12\nNow: over-current\nNow: motor does not start\n\
         Last warning: Throttle: 3 gaps\n"
    );
}

#[test]
fn the_metadata_can_be_found() {
    let mut bench = Bench::new();
    let general = fetch(&mut bench, "general.json.xz", 239);
    // COMPONENT_METADATA, and its predecessor COMPONENT_INFORMATION.
    for (message, uri_at) in [(397, 8), (395, 12)] {
        let command = COMMAND_LONG_DATA {
            target_system: 1,
            target_component: 1,
            param1: message as f32,
            command: MavCmd::MAV_CMD_REQUEST_MESSAGE,
            ..COMMAND_LONG_DATA::default()
        };
        let sent = bench.ask(&command);
        assert_eq!(count(&sent, 77), 1);
        let metadata = sent.iter().find(|s| s.message.message_id() == message);
        let payload = &metadata.expect("it was asked for").payload;
        assert_eq!(payload[..4], 1000_u32.to_le_bytes());
        assert_eq!(payload[4..8], crc32(&general).to_le_bytes());
        assert!(payload[uri_at..].starts_with(b"mftp:///general.json.xz\0"));
    }
}

#[test]
fn statistics_are_told_in_words() {
    let mut bench = Bench::new();
    bench.telemetry.statistics = Statistics {
        run_s: 3_661,
        starts: 10,
        faults: [0, 0, 0, u32::MAX, 0, 1, 0, 0],
        temperature_max_c: 61.6,
        phase_max_a: 0.0,
    };
    let text = fetch(&mut bench, "@SYS/statistics.txt", 239);
    let wanted = "Run time: 3661 s\n\
                  Starts: 10\n\
                  Highest temperature: 61 C\n\
                  Highest phase current: 0 A\n\
                  Fault, over-temperature: 4294967295\n\
                  Fault, motor does not start: 1\n";
    assert_eq!(String::from_utf8(text).expect("ASCII"), wanted);
}
