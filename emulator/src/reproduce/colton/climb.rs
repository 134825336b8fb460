//! Figures 50 and 52 of the second paper: a climbing quadrotor's drive, and its observed flux over speed.

use std::f64::consts::TAU;

use siskin_control::build::FluxSettings;
use siskin_control::control::observer::limits;
use siskin_control::drive::Phase;
use siskin_params::ParamId;

use super::bench::quadrotor;
use super::sheet::{between, evenly, figure};
use crate::plot::chart::{Axis, Curve, Map, Panel};
use crate::reproduce::item::{Item, Reproduction, item};
use crate::shaft::Units;

/// Hover and climb speeds, rpm.
const HOVER_RPM: f64 = 4000.0;
const CLIMB_RPM: f64 = 6000.0;
/// The slew limit that the paper assumes in 2.4, rpm/s.
const SLEW_RPM_S: f64 = 10_000.0;
/// When the start is over and the picture begins, s.
const BEGIN_S: f64 = 2.0;
/// When the climb begins, and the picture's length, s.
const CLIMB_S: f64 = 0.1;
const LENGTH_S: f64 = 0.8;
/// Averaging window of the picture's currents and speeds, as in telemetry, s.
const MEAN_S: f64 = 1e-3;

/// Speed range of figure 52, rpm, and its sweep rate, rpm/s.
const SPEEDS_RPM: [f64; 2] = [1500.0, 6000.0];
const SWEEP_RPM_S: f64 = 1500.0;
/// Columns and rows of the map.
const COLUMNS: usize = 72;
const ROWS: usize = 45;

/// A sample of the climb.
struct Seen {
    time_s: f64,
    runs: bool,
    command_rpm: f64,
    measured_rpm: f64,
    i_q_a: f64,
    i_d_a: f64,
}

/// Figure 50: closed-loop speed control through a climb, with the loop of figure 47 and the modified synchronous
/// regulator.
pub(super) fn climb() -> Reproduction {
    let bench = quadrotor(&[]);
    let (inertia, per_a) = (
        bench.motor.inertia_kgm2 + bench.load.inertia_kgm2,
        bench.torque_nm_per_a(),
    );
    let fastest_rad_s = CLIMB_RPM * TAU / 60.0;
    let steady_a = bench.load.c2 * fastest_rad_s * fastest_rad_s / per_a;
    let slew_a = inertia * SLEW_RPM_S * TAU / 60.0 / per_a;
    let mut drive = quadrotor(&[
        (ParamId::CtlRegulator, 2.0),
        (ParamId::CtlSpeed, 1.0),
        (ParamId::CtlSlewRpmS, SLEW_RPM_S),
        (ParamId::CtlRpmMax, CLIMB_RPM),
        (ParamId::CtlFfA, steady_a),
    ]);
    let (hover, high) = (drive.at_rpm(HOVER_RPM), drive.at_rpm(CLIMB_RPM));
    drive.run(hover, BEGIN_S, |_, _, _| {});
    let mut seen = Vec::new();
    for (setpoint, for_s) in [(hover, CLIMB_S), (high, LENGTH_S - CLIMB_S)] {
        drive.run(setpoint, for_s, |t_s, _, rig| {
            let (snapshot, units) = (rig.snapshot(), Units::of(rig.config()));
            seen.push(Seen {
                time_s: t_s - BEGIN_S,
                runs: snapshot.phase == Phase::Run,
                command_rpm: units.rpm(snapshot.speed_reference),
                measured_rpm: units.rpm(snapshot.speed),
                i_q_a: f64::from(units.scale.amperes(snapshot.i.q)),
                i_d_a: f64::from(units.scale.amperes(snapshot.i.d)),
            });
        });
    }
    let ran = seen.iter().all(|seen| seen.runs);
    let means: Vec<Seen> = seen
        .chunks(libm::round(MEAN_S / drive.rig.period_s()) as usize)
        .map(mean)
        .collect();
    let peak_a = means.iter().map(|seen| seen.i_q_a).reduce(f64::max);
    let end = mean(&seen[seen.len() - seen.len() / 8..]);
    let measured = |value: Option<f64>| value.filter(|_| ran);
    let items = vec![
        item(
            "fig50_peak_i_q",
            Some(steady_a + slew_a),
            measured(peak_a),
            "A",
            "4000 to 6000 rpm at 10,000 rpm/s; torque of the propeller and of the slew (the paper's \
             drive peaks above 10 A)",
        ),
        item(
            "fig50_i_d",
            Some(0.0),
            measured(Some(end.i_d_a)),
            "A",
            "mean at the end of the climb: regulated to zero",
        ),
        item(
            "fig50_speed",
            Some(CLIMB_RPM),
            measured(Some(end.measured_rpm)),
            "rpm",
            "mean at the end of the climb; the command",
        ),
    ];
    let over_time = |value: fn(&Seen) -> f64| -> Vec<(f64, f64)> {
        means
            .iter()
            .map(|seen| (seen.time_s, value(seen)))
            .collect()
    };
    let time = || between("time (s)", 0.0, LENGTH_S);
    let speeds = vec![
        Curve::line("measured by the drive", over_time(|seen| seen.measured_rpm)),
        Curve::dashed(
            "command behind its slew limit",
            over_time(|seen| seen.command_rpm),
        ),
    ];
    let currents = vec![
        Curve::line("i_q", over_time(|seen| seen.i_q_a)),
        Curve::line("i_d", over_time(|seen| seen.i_d_a)),
    ];
    Reproduction {
        items,
        figures: vec![figure(
            "colton-50",
            "Closed-loop speed control of a climb (Colton 2014, figure 50)",
            1,
            vec![
                Panel::new("speed", time(), Axis::new("speed (rpm)"), speeds),
                Panel::new(
                    "currents, means of 1 ms",
                    time(),
                    Axis::new("current (A)"),
                    currents,
                ),
            ],
        )],
    }
}

/// Returns the mean of some samples.
fn mean(seen: &[Seen]) -> Seen {
    let of = |value: fn(&Seen) -> f64| seen.iter().map(value).sum::<f64>() / seen.len() as f64;
    Seen {
        time_s: of(|seen| seen.time_s),
        runs: seen.iter().all(|seen| seen.runs),
        command_rpm: of(|seen| seen.command_rpm),
        measured_rpm: of(|seen| seen.measured_rpm),
        i_q_a: of(|seen| seen.i_q_a),
        i_d_a: of(|seen| seen.i_d_a),
    }
}

/// Figure 52: phase a's observed flux over the speed and the rotor's angle.
pub(super) fn flux_map() -> Reproduction {
    let mut drive = quadrotor(&[(ParamId::CtlSlewRpmS, SWEEP_RPM_S)]);
    let [from, to] = SPEEDS_RPM;
    let (slow, fast) = (drive.at_rpm(from), drive.at_rpm(to + 100.0));
    drive.run(slow, 2.5, |_, _, _| {});
    let mut cells = vec![[(0.0, 0.0); COLUMNS]; ROWS];
    drive.run(fast, (to - from) / SWEEP_RPM_S + 0.3, |_, period, rig| {
        let row = (period.rpm() - from) / (to - from) * ROWS as f64;
        if rig.snapshot().phase == Phase::Run && (0.0..ROWS as f64).contains(&row) {
            let column = (period.motion.angle_turns * COLUMNS as f64) as usize % COLUMNS;
            let (sum, count) = &mut cells[row as usize][column];
            *sum += rig.flux_linkages_wb()[0] * 1e3;
            *count += 1.0;
        }
    });
    let rows: Vec<Vec<f64>> = cells
        .iter()
        .map(|row| row.iter().map(|(sum, count)| sum / count).collect())
        .collect();
    let settings = FluxSettings::new(&drive.params);
    let centre = |index: usize, count: usize| (index as f64 + 0.5) / count as f64;
    let speed = |row: usize| from + (to - from) * centre(row, ROWS);
    let items = [0, ROWS / 2, ROWS - 1].map(|row| {
        let flux_mwb = drive.motor.flux_wb * 1e3;
        let omega_rad_s = speed(row) * f64::from(drive.motor.pole_pairs) * TAU / 60.0;
        amplitude(&rows[row], (speed(row), omega_rad_s), flux_mwb, &settings)
    });
    let distortion = rows.iter().map(|row| distortion(row)).reduce(f64::max);
    let mut items = items.to_vec();
    items.push(item(
        "fig52_distortion",
        None,
        distortion,
        "%",
        "rms of what is not the fundamental, at the worst speed: \"sinusoidal and clean\"",
    ));
    let map = Map {
        label: "flux linkage (mWb)".to_owned(),
        x: (0..COLUMNS)
            .map(|column| 360.0 * centre(column, COLUMNS))
            .collect(),
        y: (0..ROWS).map(speed).collect(),
        rows,
        range: None,
    };
    let (x, y) = (
        between("rotor electrical angle (degrees)", 0.0, 360.0),
        between("speed (rpm)", from, to),
    );
    let mut panel = Panel::new("phase a", x, y, Vec::new());
    panel.map = Some(map);
    Reproduction {
        items,
        figures: vec![figure(
            "colton-52",
            "Observed flux over speed and angle (Colton 2014, figure 52)",
            1,
            vec![panel],
        )],
    }
}

/// Returns the cosine and sine parts of a row of the map.
fn fundamental(row: &[f64]) -> (f64, f64) {
    let angles = evenly(0.5, COLUMNS as f64 - 0.5, COLUMNS as u32);
    let parts = row.iter().zip(angles).map(|(value, at)| {
        let (sin, cos) = libm::sincos(TAU * at / COLUMNS as f64);
        (value * cos, value * sin)
    });
    let (cos, sin) = parts.fold((0.0, 0.0), |sum, part| (sum.0 + part.0, sum.1 + part.1));
    (2.0 * cos / COLUMNS as f64, 2.0 * sin / COLUMNS as f64)
}

/// Compares the amplitude at a speed with what the high-passes leave of the motor's: the cosine of each one's lead.
fn amplitude(
    row: &[f64],
    (rpm, omega_rad_s): (f64, f64),
    flux_mwb: f64,
    settings: &FluxSettings,
) -> Item {
    let left = |tau_s: f32| {
        let lead_deg = limits::low_pass(f64::from(tau_s), omega_rad_s);
        libm::cos(lead_deg * TAU / 360.0)
    };
    let left = left(settings.tau_int_s) * settings.tau_hpfs_s.map_or(1.0, left);
    let (cos, sin) = fundamental(row);
    let measured = libm::hypot(cos, sin);
    item(
        format!("fig52_amplitude_{rpm:.0}"),
        Some(flux_mwb * left),
        measured,
        "mWb",
        "amplitude of the observed flux; the motor's, by the formula of the integrator",
    )
}

/// Returns the rms of everything but the fundamental over the fundamental's, %.
fn distortion(row: &[f64]) -> f64 {
    let (cos, sin) = fundamental(row);
    let power = row.iter().map(|value| value * value).sum::<f64>() / COLUMNS as f64;
    let wanted = 0.5 * (cos * cos + sin * sin);
    100.0 * libm::sqrt((power / wanted - 1.0).max(0.0))
}
