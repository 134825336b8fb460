//! `siskin decode`: captures in, tables out.

mod generator;
#[path = "../common/run.rs"]
mod run;
mod summary;
mod table;

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use serde_json::Value;

use generator::{Layout, Wire, word};
use run::{Run, siskin};

/// Runs it on a capture; returns exit status, stdout and stderr.
fn decode(capture: impl AsRef<[u8]>, arguments: &[&str]) -> (i32, String, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("capture");
    fs::write(&file, capture).expect("written");
    let file = file.to_str().expect("text");
    let Run { status, out, err } = siskin(&[&["decode", file], arguments].concat());
    (status, out, err)
}

/// Returns its lines as JSON objects: the rows, and the summary.
#[track_caller]
fn rows(capture: impl AsRef<[u8]>, arguments: &[&str]) -> (Vec<Value>, Value) {
    let (status, out, err) = decode(capture, &[arguments, &["--json"]].concat());
    assert_eq!((status, err.as_str()), (0, ""));
    let lines = out.lines().map(serde_json::from_str);
    let mut rows: Vec<Value> = lines.collect::<Result<_, _>>().expect("an object a line");
    let summary = rows.pop().expect("the last line")["summary"].clone();
    (rows, summary)
}

/// What the sender of [`drill`] sends: a value and its count.
const DRILL: [(u16, u64); 4] = [(0, 60), (13, 10), (48, 1), (1046, 29)];

/// 100 frames at 2 kHz, from 1 ms on, with replies if they are bidirectional.
fn drill(bit_hz: f64, bidirectional: bool) -> Wire {
    let mut wire = Wire::new(bidirectional);
    let mut at_ns = 1e6;
    for (value, times) in DRILL {
        for _ in 0..times {
            let end_ns = wire.frame(at_ns, word(value, false, bidirectional), bit_hz);
            if bidirectional {
                // 500 us per turn.
                wire.reply(
                    end_ns + 30_000.0,
                    0x1F4 << 4 | !(0x1 ^ 0xF ^ 0x4) & 0xF,
                    bit_hz * 1.25,
                );
            }
            at_ns += 500_000.0;
        }
    }
    wire
}

/// Asserts that the rows and the summary are those of [`drill`].
#[track_caller]
fn is_the_drill((rows, summary): &(Vec<Value>, Value), signal: &str, begin_s: f64) {
    assert_eq!(summary["signal"], signal);
    assert_eq!(
        (&summary["good"], &summary["bad"]),
        (&100.into(), &0.into()),
        "{summary}"
    );
    let seen: Vec<_> = rows
        .iter()
        .map(|row| (row["value"].as_u64(), row["times"].as_u64()))
        .collect();
    let meant = DRILL.map(|(value, times)| (Some(value.into()), Some(times)));
    assert_eq!(seen, meant);
    let first_s = rows[0]["time_s"].as_f64().expect("a time");
    assert!((first_s - begin_s).abs() < 0.5e-6, "{first_s}");
    assert_eq!(rows[1]["command"], "13 extended telemetry on");
    let throttle = rows[3]["throttle"].as_f64().expect("a share");
    assert!((throttle - 998.0 / 1999.0).abs() < 1e-4, "{throttle}");
    let rate_hz = summary["rate_hz"]["mean"].as_f64().expect("a rate");
    assert!((rate_hz - 2000.0).abs() < 1.0, "{rate_hz}");
}

const RATES: [f64; 4] = [150e3, 300e3, 600e3, 1200e3];

#[test]
fn every_format_decodes_alike() {
    let wire = drill(600e3, false);
    for (name, capture, begin_s) in [
        ("Logic 2", wire.saleae(24.0), 0.001),
        ("Logic 1", wire.saleae_1(24.0), -0.499),
        ("VCD in ns", wire.vcd(25.0, "1 ns", 1e3), 0.001),
        ("VCD in 10 ps", wire.vcd(24.0, "10ps", 1e5), 0.001),
        ("VCD of 24 MHz in ns", wire.vcd(24.0, "1 ns", 1e3), 0.001),
    ] {
        println!("{name}");
        let arguments: &[&str] = if capture.starts_with('$') {
            &["--channel", "d0"]
        } else {
            &[]
        };
        is_the_drill(&rows(capture, arguments), "DShot600", begin_s);
    }
}

#[test]
fn every_sigrok_layout_decodes_alike() {
    let wire = drill(600e3, false);
    for layout in [
        Layout::Time,
        Layout::TimeWithoutRepeats,
        Layout::TimeAndNames,
        Layout::Levels,
        Layout::Bare,
    ] {
        println!("{layout:?}");
        // At 24 MHz the time column is 1.6 % off, and starts one period late.
        let begin_s = match layout {
            Layout::Levels | Layout::Bare => 0.001,
            _ => 0.001 + 1.0 / 24e6,
        };
        is_the_drill(&rows(wire.sigrok(24, layout), &[]), "DShot600", begin_s);
    }
}

#[test]
fn every_dshot_rate_is_detected() {
    for (bit_hz, number) in RATES.into_iter().zip([150, 300, 600, 1200]) {
        for mhz in [16.0, 24.0, 100.0] {
            let capture = drill(bit_hz, false).saleae(mhz);
            is_the_drill(&rows(capture, &[]), &format!("DShot{number}"), 0.001);
        }
        for mhz in [24.0, 100.0] {
            let seen = rows(drill(bit_hz, true).saleae(mhz), &[]);
            is_the_drill(&seen, &format!("bidirectional DShot{number}"), 0.001);
            let (rows, summary) = seen;
            assert_eq!(summary["replies_good"], 100, "{summary}");
            assert!(
                rows.iter().all(|row| row["reply"]["erpm"] == 120_000),
                "{rows:?}"
            );
            let delay_us = &summary["reply_delay_us"];
            for bound in ["min", "max"] {
                let delay_us = delay_us[bound].as_f64().expect("a time");
                assert!((delay_us - 30.0).abs() < 0.1, "{delay_us}");
            }
        }
    }
}

#[test]
fn every_pulse_protocol_is_detected() {
    for (name, least_us, most_us, hz) in [
        ("servo", 1000.0, 2000.0, 50.0),
        ("servo", 1000.0, 2000.0, 450.0),
        ("OneShot125", 125.0, 250.0, 2000.0),
        ("OneShot42", 42.0, 84.0, 4000.0),
        ("Multishot", 5.0, 25.0, 8000.0),
    ] {
        let mut wire = Wire::new(false);
        let half_us = (least_us + most_us) / 2.0;
        for pulse in 0..200 {
            let width_us = if pulse < 150 { least_us } else { half_us };
            wire.pulse(1e6 + f64::from(pulse) * 1e9 / hz, width_us * 1e3);
        }
        let (rows, summary) = rows(wire.saleae(24.0), &[]);
        assert_eq!(summary["signal"], name, "{summary}");
        assert_eq!(
            (&summary["good"], &summary["bad"]),
            (&200.into(), &0.into()),
            "{summary}"
        );
        let seen: Vec<_> = rows
            .iter()
            .map(|row| (row["times"].as_u64(), row["throttle"].as_f64()))
            .collect();
        assert_eq!(seen.len(), 2, "{seen:?}");
        assert_eq!(seen[0], (Some(150), Some(0.0)));
        assert_eq!(seen[1].0, Some(50));
        // The lowest 2 % of the range are zero, and the rest is linear.
        let share = seen[1].1.expect("a share");
        assert!((share - 0.48 / 0.98).abs() < 0.003, "{seen:?}");
        let rate_hz = summary["rate_hz"]["mean"].as_f64().expect("a rate");
        assert!((rate_hz / hz - 1.0).abs() < 1e-3, "{rate_hz}");
    }
}

#[test]
fn a_dump_in_microseconds_carries_servo_pulses() {
    let mut wire = Wire::new(false);
    for pulse in 0..20 {
        wire.pulse(1e6 + f64::from(pulse) * 20e6, 1_265e3);
    }
    let (rows, summary) = rows(wire.vcd(1.0, "1 us", 1.0), &["--channel", "D0"]);
    assert_eq!(summary["signal"], "servo", "{summary}");
    assert_eq!(rows.len(), 1, "{rows:?}");
    assert_eq!(rows[0]["times"], 20);
    assert_eq!(rows[0]["width_us"], 1265.0);
    assert_eq!(rows[0]["throttle"], 0.25);
}

#[test]
fn frames_at_the_esc_s_closest_spacing_are_all_decoded() {
    for (bit_hz, telemetry) in [(600e3, false), (600e3, true), (630e3, false), (630e3, true)] {
        let bit_ns = 1e9 / bit_hz;
        let mut wire = Wire::new(false);
        let mut at_ns = 1e6;
        for _ in 0..50 {
            wire.frame(at_ns, word(1046, telemetry, false), bit_hz);
            let (last_ns, _) = *wire.edges.last().expect("a frame");
            at_ns = last_ns + 1.55 * bit_ns;
        }
        let (rows, summary) = rows(wire.saleae(100.0), &[]);
        assert_eq!(
            (&summary["good"], &summary["bad"]),
            (&50.into(), &0.into()),
            "{bit_hz} {telemetry}: {summary}"
        );
        assert_eq!(rows[0]["times"], 50, "{rows:?}");
        assert!(summary["bit_ns"].is_object(), "{summary}");
    }
}

#[test]
fn a_capture_may_begin_and_end_anywhere() {
    for bidirectional in [false, true] {
        let whole = drill(300e3, bidirectional);
        let edges = whole.edges.len();
        for cut in [1, 2, 17, 31] {
            let mut wire = Wire::new(whole.edges[cut - 1].1);
            wire.edges = whole.edges[cut..edges - cut].to_vec();
            let (_, summary) = rows(wire.saleae(24.0), &[]);
            let good = summary["good"].as_u64().expect("a count");
            assert!((98..=99).contains(&good), "cut {cut}: {summary}");
        }
    }
}

#[test]
fn a_named_signal_is_decoded_as_such() {
    let capture = drill(600e3, false).saleae(24.0);
    for name in ["12", "dshot600", "DShot600"] {
        is_the_drill(&rows(&capture, &["--protocol", name]), "DShot600", 0.001);
    }
    // All frames are bad, which is a result and not a usage error.
    for name in ["bidirectional-dshot600", "11"] {
        let (_, summary) = rows(&capture, &["--protocol", name]);
        assert_eq!(summary["good"], 0, "{summary}");
        assert!(summary["bad"].as_u64() >= Some(90), "{summary}");
    }
}

#[test]
fn a_closed_reader_is_no_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("capture.csv");
    let mut wire = Wire::new(false);
    for frame in 0..5000 {
        wire.frame(
            1e6 + f64::from(frame) * 100e3,
            word(frame % 2000, false, false),
            600e3,
        );
    }
    fs::write(&file, wire.saleae(24.0)).expect("written");
    let mut run = Command::new(env!("CARGO_BIN_EXE_siskin"))
        .arg("decode")
        .arg(&file)
        .arg("--all")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary that cargo built");
    let mut line = String::new();
    let mut out = BufReader::with_capacity(64, run.stdout.take().expect("piped"));
    out.read_line(&mut line).expect("a line");
    drop(out);
    let ended = run.wait_with_output().expect("it ends");
    assert_eq!((ended.status.code(), ended.stderr), (Some(0), Vec::new()));
}

#[test]
fn bad_input_ends_with_one_line_that_says_what_to_do() {
    let wire = drill(600e3, false);
    let saleae = wire.saleae(24.0);
    let vcd = wire.vcd(24.0, "1 ns", 1e3);
    let quiet = "Time [s],Channel 0\n0,0\n1,0\n".to_owned();
    let back = "Time [s],Channel 0\n0,0\n2,1\n1,0\n".to_owned();
    let noise: String = (0..400_u64)
        .map(|edge| format!("{}e-9,{}\n", edge * edge * 137 + edge, edge % 2))
        .collect();
    for (capture, arguments, named) in [
        (String::new(), &[][..], "no table"),
        ("\0\u{1}\u{2}".to_owned(), &[], "neither CSV nor VCD"),
        ("PK\u{3}\u{4}".to_owned(), &[], "export it as CSV or VCD"),
        (
            "nothing,to,see\n1,2,3\n".to_owned(),
            &[],
            "nor a sample rate",
        ),
        ("0,1\n1,0\n".to_owned(), &[], "it has no header"),
        ("Time [s],A\n0,0\n1,3.3\n".to_owned(), &[], "line 3: '3.3'"),
        ("Time [s],A\nnoon,0\n".to_owned(), &[], "line 2: 'noon'"),
        (
            "Time [s],A,B\n0,0\n".to_owned(),
            &[],
            "line 2: 1 columns are missing",
        ),
        (back, &[], "line 4"),
        (quiet, &[], "no edge"),
        (
            format!("Time [s],Channel 0\n{noise}"),
            &[],
            "no throttle signal",
        ),
        (saleae.clone(), &["--channel", "7"], "'7'"),
        (saleae.clone(), &["--protocol", "dshot900"], "dshot900"),
        (
            saleae.replace("0.001000000", "1e300"),
            &[],
            "beyond 30 years",
        ),
        (vcd.clone(), &[], "0 libsigrok.D0, 1 libsigrok.D1"),
        (
            vcd.replace("$timescale 1 ns $end", ""),
            &[],
            "no $timescale",
        ),
        (vcd.replace("$enddefinitions", "$nothing"), &[], "line 8"),
    ] {
        let (status, out, err) = decode(&capture, arguments);
        assert_eq!((status, out.as_str()), (2, ""), "{named}: {out} {err}");
        assert_eq!(err.lines().count(), 1, "{err}");
        assert!(err.contains(named), "{named}: {err}");
    }
    let (status, _, err) = decode("", &["--no-such"]);
    assert_eq!((status, err.lines().count()), (2, 1));
    let Run { status, err, .. } = siskin(&["decode", "no-such.csv"]);
    assert_eq!((status, err.lines().count()), (2, 1), "{err}");
    assert!(err.contains("no-such.csv"), "{err}");
}
