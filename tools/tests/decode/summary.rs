//! The summary of a capture.

use crate::generator::{Layout, Wire, word};
use crate::{decode, drill, rows};

#[test]
fn timing_is_measured() {
    let mut wire = Wire::new(false);
    let mut at_ns = 1e6;
    for frame in 0..200 {
        // 3 % fast, then half a second of silence.
        wire.frame(at_ns, word(frame, false, false), 618e3);
        at_ns += if frame == 120 { 5e8 } else { 250e3 };
    }
    let (_, summary) = rows(wire.saleae(100.0), &[]);
    let number = |key: &str, bound: &str| summary[key][bound].as_f64().expect("a number");
    assert!(
        (number("bit_ns", "mean") - 1e9 / 618e3).abs() < 1.0,
        "{summary}"
    );
    assert!((number("ones_pct", "mean") - 75.0).abs() < 1.0, "{summary}");
    assert!(
        (number("zeros_pct", "mean") - 37.5).abs() < 1.0,
        "{summary}"
    );
    assert!(summary["jitter_max_ns"].as_f64() <= Some(15.0), "{summary}");
    assert!((number("rate_hz", "min") - 4000.0).abs() < 1.0, "{summary}");
    assert_eq!(summary["gaps"], 1);
    let gap_s = summary["longest_gap_s"].as_f64().expect("a time");
    assert!((gap_s - 0.5).abs() < 1e-6, "{summary}");
}

#[test]
fn the_mean_rate_counts_frames() {
    let mut wire = Wire::new(false);
    let mut at_ns = 1e6;
    for frame in 0..101 {
        wire.frame(at_ns, word(1046, false, false), 600e3);
        at_ns += if frame % 2 == 0 { 50e3 } else { 200e3 };
    }
    let (_, summary) = rows(wire.saleae(100.0), &[]);
    for (bound, meant_hz) in [("min", 5e3), ("mean", 8e3), ("max", 20e3)] {
        let rate_hz = summary["rate_hz"][bound].as_f64().expect("a rate");
        assert!((rate_hz / meant_hz - 1.0).abs() < 1e-3, "{summary}");
    }
}

#[test]
fn commands_are_counted_with_the_longest_run_of_each() {
    let mut wire = Wire::new(false);
    let values = [(0, 60), (7, 5), (0, 1), (7, 3), (1, 1), (12, 10), (31, 5)];
    let mut at_ns = 1e6;
    for (value, times) in values {
        for _ in 0..times {
            wire.frame(at_ns, word(value, true, false), 300e3);
            at_ns += 1e6;
        }
    }
    // A bad frame ends a run, and ignored commands are never too few.
    for bits in [13, 13, 13, 0, 13, 13, 13, 32].map(|value| word(value, true, false)) {
        let wrong = if bits == word(0, true, false) { 1 } else { 0 };
        wire.frame(at_ns, bits ^ wrong, 300e3);
        at_ns += 1e6;
    }
    let capture = wire.saleae(24.0);
    let (_, summary) = rows(&capture, &[]);
    let commands = summary["commands"].as_array().expect("a list");
    let seen: Vec<_> = commands
        .iter()
        .map(|seen| {
            ["command", "times", "in_a_row"].map(|key| seen[key].as_u64().expect("a number"))
        })
        .collect();
    assert_eq!(
        seen,
        [
            [1, 1, 1],
            [7, 8, 5],
            [12, 10, 10],
            [13, 6, 3],
            [31, 5, 5],
            [32, 1, 1]
        ]
    );
    assert_eq!(summary["telemetry"], 92);
    let (_, out, _) = decode(&capture, &[]);
    for line in [
        "7 spin direction 1: 8 frames, 5 in a row, too few: it takes 6 in a row\n",
        "12 save settings: 10 frames, 10 in a row\n",
        "13 extended telemetry on: 6 frames, 3 in a row, too few: it takes 6 in a row\n",
        "31 silent mode: 5 frames, 5 in a row, too few: it takes 6 in a row\n",
        "32 signal line telemetry off: 1 frames, 1 in a row\n",
    ] {
        assert!(out.contains(line), "{line} {out}");
    }
}

#[test]
fn a_coarse_capture_is_warned_of() {
    for (bit_hz, mhz, coarse) in [
        (150e3, 4.0, false),
        (300e3, 4.0, false),
        (600e3, 4.0, true),
        (600e3, 8.0, false),
        (1200e3, 12.0, true),
    ] {
        let (_, summary) = rows(drill(bit_hz, false).saleae(mhz), &[]);
        assert_eq!(
            summary["warning"].is_string(),
            coarse,
            "{bit_hz} {mhz}: {summary}"
        );
    }
    let (_, out, _) = decode(drill(600e3, false).sigrok(4, Layout::Levels), &[]);
    assert!(out.contains("sample at 7.2 MHz or more"), "{out}");
    // At one sample per bit nothing decodes, and the message says why.
    let (status, out, err) = decode(drill(600e3, false).sigrok(1, Layout::Levels), &[]);
    assert_eq!((status, out.as_str()), (2, ""));
    assert!(
        err.contains("sample at 24 MHz or more instead of 1 MHz"),
        "{err}"
    );
}
