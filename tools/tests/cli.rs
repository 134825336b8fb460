//! The whole program against the real MAVLink component.

#[path = "common/esc.rs"]
mod esc;
#[path = "common/run.rs"]
mod run;

use std::fs;

use esc::{Behaviour, Esc, UdpRelay};
use run::{Run, siskin};
use serde_json::Value;
use siskin_params::{ParamId, Params, TABLE};

/// Asserts the status and returns the output.
#[track_caller]
fn ended(run: &Run, status: i32) -> &str {
    assert_eq!(run.status, status, "{run:?}");
    &run.out
}

#[test]
fn the_list_is_complete_with_every_fifth_packet_lost() {
    for lose_every in [None, Some(5)] {
        let esc = Esc::start(Behaviour {
            lose_every,
            ..Behaviour::default()
        });
        let run = esc.siskin(&["params", "list"]);
        let params = Params::default();
        let expected: Vec<(String, f32)> = ParamId::ALL
            .iter()
            .map(|&id| (id.entry().name.into(), params.get(id)))
            .collect();
        let listed: Vec<(String, f32)> = ended(&run, 0)
            .lines()
            .map(|line| {
                let mut words = line.split_whitespace();
                let (name, value) = (words.next().expect("a name"), words.next());
                let value = value.expect("a value").parse().expect("a number");
                (name.into(), value)
            })
            .collect();
        assert_eq!(listed, expected);
        assert_eq!(run.err, "");
        esc.stop();
    }
}

#[test]
fn get_prints_known_parameters_and_names_unknown_ones() {
    let esc = Esc::start(Behaviour {
        lose_every: Some(3),
        ..Behaviour::default()
    });
    let run = esc.siskin(&[
        "params",
        "get",
        "--json",
        "CTL_FF_A",
        "NO_SUCH",
        "inp_arm_ms",
    ]);
    let values: Value = serde_json::from_str(ended(&run, 1)).expect("JSON");
    assert_eq!(
        values,
        serde_json::json!({ "CTL_FF_A": 8.4, "INP_ARM_MS": 300.0 })
    );
    assert!(
        run.err.contains("NO_SUCH: no such parameter"),
        "{}",
        run.err
    );
    assert!(
        run.err.contains("1 of 3 parameters not read"),
        "{}",
        run.err
    );
    esc.stop();
}

#[test]
fn set_reports_each_value_and_the_reason_of_each_refusal() {
    let esc = Esc::start(Behaviour {
        lose_every: Some(5),
        ..Behaviour::default()
    });
    let run = esc.siskin(&[
        "params",
        "set",
        "--store",
        "LIM_PHASE_A",
        "15.5",
        "MOT_STOP",
        "0",
    ]);
    let out = ended(&run, 0);
    assert!(out.contains("15.5") && out.ends_with("stored\n"), "{out}");
    for (name, value, reason) in [
        (
            "lim_phase_a",
            "1e9",
            "LIM_PHASE_A 1000000000: refused: out of range; it stays 15.5",
        ),
        ("MOT_KV", "100", "read-only"),
        ("MOT_POLE_PAIRS", "6.5", "whole number; it stays 0"),
        ("NO_SUCH", "1", "no such parameter"),
    ] {
        let run = esc.siskin(&["params", "set", "--store", name, value]);
        ended(&run, 1);
        assert!(run.err.contains(reason), "{name}: {}", run.err);
        assert!(
            run.err.contains("1 of 1 value refused; nothing was stored"),
            "{}",
            run.err
        );
    }
    let outcome = esc.stop();
    assert_eq!(outcome.saves, 1);
    assert_eq!(outcome.params.get(ParamId::LimPhaseA), 15.5);
    assert_eq!(outcome.params.get(ParamId::MotStop), 0.0);
}

/// It is taken, since others may follow, but the motor is off until they do.
#[test]
fn what_makes_no_drive_with_the_others_is_told() {
    let esc = Esc::start(Behaviour::default());
    let run = esc.siskin(&["params", "set", "CTL_RPM_MIN", "7000"]);
    ended(&run, 0);
    let told = "Motor off: CTL_RPM_MIN 7000.000 must be below CTL_RPM_MAX";
    assert!(run.err.contains(told), "{}", run.err);
    let run = esc.siskin(&["params", "set", "CTL_RPM_MIN", "300"]);
    ended(&run, 0);
    assert_eq!(run.err, "");
    esc.stop();
}

#[test]
fn a_storage_failure_is_reported_with_its_reason() {
    let esc = Esc::start(Behaviour {
        storage_fault: Some("flash worn out"),
        ..Behaviour::default()
    });
    let run = esc.siskin(&["params", "set", "--store", "MOT_DIR", "1"]);
    ended(&run, 1);
    assert!(
        run.err.contains("storing: failed") && run.err.contains("flash worn out"),
        "{}",
        run.err
    );
    assert_eq!(esc.stop().saves, 1);
}

#[test]
fn a_saved_file_loads_into_another_esc() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("motor.param");
    let file = file.to_str().expect("text");

    let first = Esc::start(Behaviour::default());
    let changes = [
        "CTL_RPM_MAX",
        "9000",
        "CTL_RPM_MIN",
        "7000",
        "MOT_FLUX_MWB",
        "2.7",
    ];
    ended(
        &first.siskin(&[&["params", "set"], &changes[..]].concat()),
        0,
    );
    ended(&first.siskin(&["params", "save", file]), 0);
    let saved = first.stop().params;
    // The last line first: now MOT_KV comes before the flux that it follows from, and the least
    // speed before the greatest, above whose old value it is.
    let text = fs::read_to_string(file).expect("written");
    assert!(text.starts_with("# "), "{text}");
    let mut lines: Vec<&str> = text.lines().collect();
    lines.reverse();
    fs::write(file, lines.join("\n")).expect("writable");

    let second = Esc::start(Behaviour {
        lose_every: Some(5),
        ..Behaviour::default()
    });
    let run = second.siskin(&["params", "load", "--store", file]);
    let summary = format!("3 changed, {} equal already, 0 refused", TABLE.len() - 3);
    assert!(ended(&run, 0).contains(&summary), "{run:?}");
    let run = second.siskin(&["params", "load", file]);
    let summary = format!("0 changed, {} equal already, 0 refused", TABLE.len());
    assert!(ended(&run, 0).contains(&summary), "{run:?}");
    let outcome = second.stop();
    assert_eq!(outcome.params, saved);
    assert_eq!(outcome.saves, 1);
}

#[test]
fn load_names_the_line_of_each_refusal() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("odd.param");
    fs::write(
        &file,
        "# odd\nMOT_STOP,0\nSERVO1_FUNCTION,33\nLIM_TEMP_C,9999\nMOT_KV,1\n",
    )
    .expect("writable");
    let file = file.to_str().expect("text");
    let esc = Esc::start(Behaviour::default());
    let run = esc.siskin(&["params", "load", "--store", file]);
    assert!(
        ended(&run, 1).contains("1 changed, 0 equal already, 3 refused"),
        "{run:?}"
    );
    let complaints: Vec<&str> = run.err.lines().collect();
    for (complaint, start, reason) in [
        (
            complaints[0],
            "line 3: SERVO1_FUNCTION 33: ",
            "no such parameter",
        ),
        (complaints[1], "line 4: LIM_TEMP_C 9999: ", "out of range"),
        (complaints[2], "line 5: MOT_KV 1: ", "read-only"),
        (
            complaints[3],
            "siskin: 3 of 4 values refused",
            "nothing was stored",
        ),
    ] {
        assert!(
            complaint.starts_with(start) && complaint.contains(reason),
            "{complaint}"
        );
    }
    let outcome = esc.stop();
    assert_eq!(outcome.saves, 0);
    assert_eq!(outcome.params.get(ParamId::MotStop), 0.0);
}

#[test]
fn monitor_prints_samples_and_ends() {
    let esc = Esc::start(Behaviour::default());
    let run = esc.siskin(&["monitor", "--json", "--count", "3"]);
    let samples: Vec<Value> = ended(&run, 0)
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).expect("JSON"))
        .filter(|object| object.get("esc").is_some())
        .collect();
    assert_eq!(samples.len(), 3);
    let last = &samples[2];
    assert_eq!((&last["esc"], &last["rpm"]), (&0.into(), &Value::from(-42)));
    assert_eq!(
        (&last["bus_v"], &last["bus_a"]),
        (&24.0.into(), &3.5.into())
    );
    let run = esc.siskin(&["monitor", "--count", "2"]);
    let rows = ended(&run, 0)
        .lines()
        .filter(|line| line.contains("-42 rpm"))
        .count();
    assert_eq!(rows, 2, "{run:?}");
    assert!(
        !run.out.contains('\x1b'),
        "no terminal, no control sequences"
    );
    esc.stop();
}

#[test]
fn udp_works_whichever_side_speaks_first() {
    for waits in [false, true] {
        let esc = Esc::start(Behaviour::default());
        let relay = UdpRelay::start(&esc, waits);
        let run = siskin(&[
            "--connect",
            relay.endpoint(),
            "params",
            "set",
            "MOT_STOP",
            "0",
        ]);
        assert_eq!(
            ended(&run, 0),
            "MOT_STOP         0 (coast)\n",
            "{}",
            relay.endpoint()
        );
        relay.stop();
        assert_eq!(esc.stop().params.get(ParamId::MotStop), 0.0);
    }
}

#[test]
fn only_the_requested_component_is_talked_to() {
    let esc = Esc::start(Behaviour::default());
    let run = esc.siskin(&["--component", "7", "params", "set", "MOT_STOP", "0"]);
    ended(&run, 2);
    assert!(
        run.err.contains("heard system 1 component 1"),
        "{}",
        run.err
    );
    ended(
        &esc.siskin(&[
            "--system",
            "1",
            "--component",
            "1",
            "params",
            "get",
            "MOT_STOP",
        ]),
        0,
    );
    assert_eq!(esc.stop().params, Params::default());
}

#[test]
fn bad_input_ends_with_one_line_and_status_2() {
    let folder = tempfile::tempdir().expect("a folder");
    let bad = folder.path().join("bad.param");
    fs::write(&bad, "MOT_STOP 0\nMOT_DIR\nMOT_DIR left\n").expect("writable");
    let bad = bad.to_str().expect("text");
    // A port below 1024, which no test binds.
    let closed = "tcp:127.0.0.1:1";
    for (arguments, complaint) in [
        (&["--connect", "usb:1", "params", "list"][..], "'usb:1'"),
        (
            &["--connect", "serial:/dev/none:9600", "params", "list"],
            "serial:/dev/none:9600",
        ),
        (
            &["--connect", closed, "params", "list"],
            "start the emulator",
        ),
        (
            &["--connect", closed, "params", "set", "MOT_STOP"],
            "2 values required",
        ),
        (
            &["--connect", closed, "params", "set", "A", "1", "B"],
            "'B' has no value",
        ),
        (
            &["--connect", closed, "params", "get", "TOO_LONG_FOR_A_NAME"],
            "TOO_LONG_FOR_A_NAME",
        ),
        (
            &["--connect", closed, "params", "load", "/no/such/file"],
            "/no/such/file",
        ),
        (
            &["--connect", closed, "params", "load", bad],
            "2 lines bad; nothing was sent",
        ),
        (&["--system", "0", "monitor"], "'0'"),
        (&["monitor", "--count", "0"], "'0'"),
        (&["parms"], "params"),
    ] {
        let run = siskin(arguments);
        ended(&run, 2);
        let last = run.err.lines().last().unwrap_or("");
        assert!(
            last.starts_with("siskin: ") && last.contains(complaint),
            "{arguments:?}: {last}"
        );
        let expected_lines = if arguments.contains(&bad) { 3 } else { 1 };
        assert_eq!(run.err.lines().count(), expected_lines, "{}", run.err);
    }
    assert!(
        siskin(&["params", "load", bad])
            .err
            .contains("bad.param: line 3: 'left'")
    );
}
