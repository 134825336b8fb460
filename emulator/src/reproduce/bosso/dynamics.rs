//! Figures 8 and 9: the published drive follows steps and an amplitude-modulated sinusoid.
//!
//! The paper prints neither the steps nor the sinusoid: 3000, 4500 and 6000 rpm, and 1000 rpm at 3 Hz
//! about 4500 rpm.

use std::f64::consts::{PI, TAU};

use siskin_control::drive::Setpoint;

use super::sensorless::{Drive, Realism};
use crate::plot::chart::{Axis, Curve, Figure, PANEL, Panel};
use crate::reproduce::item::{Item, item};

/// Time from the catch to the start of what is shown, s.
const SETTLE_S: f64 = 1.0;

/// Control periods between two points of a curve: 1 ms.
const EVERY: usize = 15;

/// When the first and last step of the stairs occur, s.
const FIRST_STEP_S: f64 = 0.1;
const LAST_STEP_S: f64 = 0.8;

/// Length of the modulated sinusoid, s.
const SINE_S: f64 = 3.0;

/// A period of a run, mechanical rpm.
#[derive(Clone, Copy, Debug)]
struct Seen {
    t_s: f64,
    command: f64,
    reference: f64,
    speed: f64,
    estimate: f64,
}

fn run(duration_s: f64, command: impl Fn(f64) -> f64) -> Vec<Seen> {
    let mut rig = Drive::Published.rig(command(0.0), Realism::Board);
    let period_s = rig.period_s();
    let settle = libm::round(SETTLE_S / period_s) as u32;
    let shown = libm::round(duration_s / period_s) as u32;
    let mut seen = Vec::new();
    for n in 0..settle + shown {
        let t_s = (f64::from(n) - f64::from(settle)) * period_s;
        let rpm = command(t_s.max(0.0));
        let scale = rig.config().scale;
        let period = rig.period(Setpoint::Speed(scale.speed_from_rpm(rpm as f32)));
        let snapshot = rig.snapshot();
        if n >= settle {
            seen.push(Seen {
                t_s,
                command: rpm,
                reference: f64::from(scale.rpm(snapshot.speed_reference)),
                speed: period.rpm(),
                estimate: f64::from(scale.rpm(snapshot.speed)),
            });
        }
    }
    seen
}

fn sinusoid(t_s: f64) -> f64 {
    let envelope = libm::sin(PI * t_s / SINE_S);
    4500.0 + 1000.0 * envelope * envelope * libm::sin(TAU * 3.0 * t_s)
}

fn stairs(rpm: [f64; 3]) -> impl Fn(f64) -> f64 {
    move |t_s| {
        rpm[if t_s < FIRST_STEP_S {
            0
        } else if t_s < LAST_STEP_S {
            1
        } else {
            2
        }]
    }
}

fn points(seen: &[Seen], value: fn(&Seen) -> f64) -> Vec<(f64, f64)> {
    let shown = seen.iter().step_by(EVERY);
    shown.map(|seen| (seen.t_s, value(seen))).collect()
}

fn speeds(title: &str, seen: &[Seen]) -> Panel {
    Panel::new(
        title,
        Axis::new("time (s)"),
        Axis::new("speed (rpm)"),
        vec![
            Curve::line("estimated", points(seen, |seen| seen.estimate)),
            Curve::line("true", points(seen, |seen| seen.speed)),
            Curve::dashed("command", points(seen, |seen| seen.command)),
            Curve::dashed("reference", points(seen, |seen| seen.reference)),
        ],
    )
}

fn rms(seen: &[Seen], value: fn(&Seen) -> f64) -> f64 {
    let squares: f64 = seen.iter().map(|seen| value(seen) * value(seen)).sum();
    libm::sqrt(squares / seen.len() as f64)
}

/// Returns the overshoot of the last step, rpm, and how long after it the speed was last more than 1 % off its end, s:
/// `None` if it still is.
fn landing(seen: &[Seen], upwards: bool) -> (f64, Option<f64>) {
    let end = seen[seen.len() - 1].command;
    let passed = seen.iter().map(|seen| {
        if upwards {
            seen.speed - end
        } else {
            end - seen.speed
        }
    });
    let off = |seen: &&Seen| (seen.speed - end).abs() > 0.01 * end;
    let last_off_s = seen.iter().rfind(off).map(|seen| seen.t_s - LAST_STEP_S);
    let lands = seen.last().is_some_and(|last| !off(&last));
    (
        passed.fold(f64::NEG_INFINITY, f64::max),
        lands.then(|| last_off_s.unwrap_or(0.0).max(0.0)),
    )
}

fn mismatch(seen: &Seen) -> f64 {
    seen.estimate - seen.reference
}

fn estimation_error(seen: &Seen) -> f64 {
    seen.estimate - seen.speed
}

/// Measures and draws figures 8 and 9.
pub(super) fn figures_8_and_9() -> (Vec<Item>, [Figure; 2]) {
    let up = || run(1.5, stairs([3000.0, 4500.0, 6000.0]));
    let down = || run(1.5, stairs([6000.0, 4500.0, 3000.0]));
    let sine = || run(SINE_S, sinusoid);
    let ((up, down), sine) = rayon::join(|| (up(), down()), sine);
    let step = |name: &str, seen: &[Seen], upwards: bool| {
        let (overshoot_rpm, settled_s) = landing(seen, upwards);
        let note = "figure 8; the paper prints no figure";
        [
            item(
                format!("fig8_{name}_overshoot"),
                None,
                overshoot_rpm,
                "rpm",
                note,
            ),
            item(
                format!("fig8_{name}_settled"),
                None,
                settled_s,
                "s",
                "time after which the speed stays within 1 %; the planner's slew takes 0.075 s",
            ),
        ]
    };
    let mut items = Vec::new();
    items.extend(step("step_up", &up, true));
    items.extend(step("step_down", &down, false));
    items.push(item(
        "fig9_mismatch_rms",
        None,
        rms(&sine, mismatch),
        "rpm",
        "figure 9(a): estimated speed less reference; 1000 rpm at 3 Hz, the paper prints neither",
    ));
    items.push(item(
        "fig9_estimation_error_rms",
        None,
        rms(&sine, estimation_error),
        "rpm",
        "figure 9(b): estimated less true speed",
    ));
    let figure_8 = Figure {
        name: "bosso-8".to_owned(),
        title: "The published drive follows steps and a modulated sinusoid (first paper, figure 8)"
            .to_owned(),
        columns: 1,
        panel: PANEL,
        panels: vec![
            speeds("(a) positive steps", &up),
            speeds("(c) negative steps", &down),
            speeds("(e) amplitude-modulated sinusoid", &sine),
        ],
    };
    let figure_9 = Figure {
        name: "bosso-9".to_owned(),
        title: "Tracking of the sinusoid of figure 8(e) (first paper, figure 9)".to_owned(),
        columns: 1,
        panel: PANEL,
        panels: vec![
            Panel::new(
                "(a) estimated speed mismatch",
                Axis::new("time (s)"),
                Axis::new("speed (rpm)"),
                vec![Curve::line(
                    "estimated − reference",
                    points(&sine, mismatch),
                )],
            ),
            Panel::new(
                "(b) speed estimation error",
                Axis::new("time (s)"),
                Axis::new("speed (rpm)"),
                vec![Curve::line(
                    "estimated − true",
                    points(&sine, estimation_error),
                )],
            ),
        ],
    };
    (items, [figure_8, figure_9])
}
