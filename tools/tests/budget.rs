//! `siskin budget`, which needs no ESC.

#[path = "common/run.rs"]
mod run;

use std::fs;

use run::{Run, siskin};
use serde_json::Value;
use siskin_params::{BOSSO_MOTOR, ParamId};

/// Exit status, stdout and stderr.
fn budget(arguments: &[&str]) -> (i32, String, String) {
    let Run { status, out, err } = siskin(&[&["budget"], arguments].concat());
    (status, out, err)
}

#[track_caller]
fn json(arguments: &[&str]) -> Value {
    let (status, out, err) = budget(&[arguments, &["--json"]].concat());
    assert_eq!((status, err.as_str()), (0, ""));
    serde_json::from_str(&out).expect("one object")
}

/// Lowest and highest speed of the only range, rpm.
#[track_caller]
fn range(budget: &Value) -> (f64, f64) {
    let ranges = budget["ranges"].as_array().expect("a list");
    assert_eq!(ranges.len(), 1, "{budget}");
    let rpm = |end: &str| ranges[0][end]["rpm"].as_f64().expect("a speed");
    (rpm("lowest"), rpm("highest"))
}

/// The motor of the paper's figures 27 to 30: acceleration and sampling, nothing else.
const FIGURE_28: [&str; 14] = [
    "--poles",
    "14",
    "--acceleration",
    "10000",
    "--braking",
    "0",
    "--pwm",
    "15625",
    "--turns",
    "1",
    "--hold-off",
    "0",
    "--tau-int",
    "inf",
];

#[test]
fn the_papers_figures_give_the_papers_ranges() {
    for (error, a_e, low, high) in [
        ("10", "0", 1000.0, 3400.0),
        ("20", "0", 500.0, 7300.0),
        ("20", "0.9", 2000.0, 7300.0),
    ] {
        let more = ["--error", error, "--a-e", a_e];
        let (from, to) = range(&json(&[&FIGURE_28[..], &more].concat()));
        // The paper says "about"; its formula makes 885 of the 1000.
        assert!((from / low - 1.0).abs() < 0.15, "{error} {a_e}: {from}");
        assert!((to / high - 1.0).abs() < 0.05, "{error} {a_e}: {to}");
    }
}

#[test]
fn contributions_add_up_to_the_bound_and_the_delay_limits_the_top() {
    let param = |(id, value): &(ParamId, f32)| format!("--param={}={value}", id.entry().name);
    let motor: Vec<_> = BOSSO_MOTOR.settings.iter().map(param).collect();
    let motor: Vec<_> = motor.iter().map(String::as_str).collect();
    let budget = json(&motor);
    assert_eq!(budget["pole_pairs"], 12.0);
    assert_eq!(budget["pwm_hz"], 24_000.0);
    assert_eq!(budget["acceleration_rpm_s"], budget["braking_rpm_s"]);
    let highest = &budget["ranges"]
        .as_array()
        .expect("a list")
        .last()
        .expect("one")["highest"];
    let rows = highest["contributions"].as_array().expect("a list");
    assert_eq!(rows[0]["source"], "digital delay");
    let sum: f64 = rows.iter().filter_map(|row| row["deg"].as_f64()).sum();
    assert!((sum - 20.0).abs() < 1e-6, "{sum}");
    // 24 kHz are 18 samples a turn at 6667 rpm of 12 pole pairs.
    let rpm = highest["rpm"].as_f64().expect("a speed");
    assert!((5000.0..6667.0).contains(&rpm), "{rpm}");
}

#[test]
fn options_override_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("esc.param");
    let text = "# Siskin\nMOT_POLE_PAIRS 7\nPWM_FREQ_HZ 48000\nMOT_KV 605.9\nCTL_FLUX_FORM 0\n";
    fs::write(&file, text).expect("written");
    let file = file.to_str().expect("text");
    let from_file = json(&[file]);
    assert_eq!(from_file["pole_pairs"], 7.0);
    assert_eq!(from_file["tau_hpfs_s"], Value::Null);
    let by_hand = json(&[
        "--poles",
        "14",
        "--pwm",
        "48000",
        "--param",
        "ctl_flux_form=0",
    ]);
    assert_eq!(from_file, by_hand);
    assert_eq!(json(&[file, "--pole-pairs", "12"])["pole_pairs"], 12.0);
}

#[test]
fn without_a_valid_speed_the_best_one_is_reported() {
    let (status, out, _) = budget(&[&FIGURE_28[..], &["--error", "3"]].concat());
    assert_eq!(status, 0);
    assert!(out.contains("within 3 deg at no speed"), "{out}");
    assert!(out.contains("best, at"), "{out}");
    let budget = json(&[&FIGURE_28[..], &["--error", "3"]].concat());
    assert_eq!(budget["ranges"], Value::Array(Vec::new()));
    assert!(budget["best"]["total_deg"].as_f64() > Some(3.0), "{budget}");
}

#[test]
fn bad_input_is_named_in_one_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("bad.param");
    fs::write(&file, "MOT_POLE_PAIRS 7\nCTL_AE 3\n").expect("written");
    let file = file.to_str().expect("text");
    for (arguments, named) in [
        (&["no-such.param"][..], "no-such.param"),
        (&[file], "line 2: CTL_AE is 0 to 0.95"),
        (&["--param", "NO_SUCH=1"], "NO_SUCH"),
        (&["--param", "CTL_AE"], "NAME=VALUE"),
        (&["--param", "CTL_POS_N=1.5"], "whole"),
        (&["--param", "MOT_KV=1"], "computed"),
        (&["--poles", "7"], "--poles"),
        (&["--poles", "14", "--pole-pairs", "7"], "--pole-pairs"),
        (&["--a-e", "1"], "--a-e"),
        (&["--error", "0"], "--error"),
        (&["--pwm", "1000"], "PWM_FREQ_HZ"),
        (&["--turns", "nan"], "--turns"),
    ] {
        let (status, out, err) = budget(arguments);
        assert_eq!((status, out.as_str()), (2, ""), "{arguments:?}");
        assert_eq!(err.lines().count(), 1, "{err}");
        assert!(err.contains(named), "{arguments:?}: {err}");
    }
}
