//! Table 1 of the second paper: each of its sources of error alone, on the running estimator,
//! against its formula.

use siskin_control::control::observer::{crossing, edges, flux_linkage, limits};
use siskin_units::{Angle, FLUX_NOMINAL, Flux, Speed};

use super::acceleration::{A_E, RPM_S, Runs, Seen, envelope, greatest};
use super::estimator::{N, SAMPLE_HZ, begun, config, fluxes, follow, hz, integrator, rad_s};
use super::sheet::{between, figure, over, ratios, spread};
use crate::plot::chart::{Curve, Panel};
use crate::reproduce::item::{Reproduction, item};

/// The table's integrator leads by 10° at this speed, rpm.
const LEAST_RPM: f64 = 500.0;
/// T_h, s.
const HOLD_OFF_S: f64 = 50e-6;
/// Rate at which the comparator is read for the hold-off, Hz: what happens between two samples is
/// the digital delay's row.
const FINE_HZ: f64 = 1e6;
/// Initial rotor angles in a sixth of a turn.
const STARTS: u32 = 16;

/// A row: the formula and the measurement, both over rpm in degrees.
struct Row {
    name: &'static str,
    formula: fn(f64) -> f64,
    measured: Vec<(f64, f64)>,
    /// Speed at which the item is taken, rpm.
    at_rpm: f64,
    note: &'static str,
}

fn tau_int_s() -> f64 {
    limits::tau_int_s(10.0, rad_s(LEAST_RPM))
}

/// Returns errors at a constant speed, of several starts, after two turns.
fn steady(rpm: f64, config: &edges::Config, begins: &edges::Config) -> Vec<f64> {
    let omega = hz(rpm);
    let samples = (12.0 * SAMPLE_HZ / omega) as u32;
    let starts = (0..STARTS).map(|start| f64::from(start) / f64::from(STARTS) / 6.0);
    let said = starts.flat_map(|start| {
        let state = begun(begins, start, omega);
        follow(config, state, move |time_s| start + omega * time_s, samples)
    });
    let settled = said.filter(|said| said.time_s * omega > 2.0);
    settled.map(|said| said.error_deg).collect()
}

/// Returns the mean lead of an integrator whose own lead is not subtracted.
fn low_pass(rpm: f64) -> Option<f64> {
    let paper = config(0.0, true);
    let known = edges::Config {
        flux: integrator(tau_int_s(), None),
        ..paper.clone()
    };
    let unknown = edges::Config {
        flux: flux_linkage::Config {
            corner: Speed::ZERO,
            ..known.flux.clone()
        },
        ..paper
    };
    let errors = steady(rpm, &unknown, &known);
    let count = errors.len() as f64;
    (count > 0.0).then(|| errors.iter().sum::<f64>() / count)
}

/// Returns the greatest error without compensation of the time from a crossing to its sample.
fn digital_delay(rpm: f64) -> Option<f64> {
    let config = config(0.0, false);
    let errors = steady(rpm, &config, &config);
    greatest(errors.into_iter().map(f64::abs))
}

/// Returns how far the rotor is beyond phase a's crossing when it is accepted, because that of
/// phase b, held back until then by a disturbance, came at the same moment.
fn hold_off(rpm: f64) -> Option<f64> {
    let omega = hz(rpm);
    let config = crossing::Config {
        hold_off: Angle::from_num(HOLD_OFF_S * omega).to_num(),
        ..config(0.0, true).crossing
    };
    let speed = Speed::from_num(omega / FINE_HZ);
    let mut state = crossing::State::default();
    crossing::begin(&mut state, Angle::ZERO);
    // From 0°, b rises at 30° and a falls at 90°.
    let falls = 0.25;
    let mut before = fluxes(0.0).map(Flux::from_num);
    let samples = (0.5 / omega * FINE_HZ) as u32;
    (1..=samples).find_map(|sample| {
        let turns = omega / FINE_HZ * f64::from(sample);
        let [a, b, c] = fluxes(turns);
        let b = if turns < falls { -b.abs() } else { b };
        let now = [a, b, c].map(Flux::from_num);
        let amplitude = FLUX_NOMINAL;
        let found = crossing::detect(&config, &mut state, &before, &now, amplitude, speed);
        before = now;
        let of_a = found.filter(|crossing| crossing.sector.edge().phase == 0);
        of_a.map(|_| (turns - falls) * 360.0)
    })
}

fn at_speeds(from: f64, to: f64, measure: fn(f64) -> Option<f64>) -> Vec<(f64, f64)> {
    let speeds = spread(from, to, 14);
    speeds
        .filter_map(|rpm| Some((rpm, measure(rpm)?)))
        .collect()
}

/// Returns the greatest error of a run around each speed.
fn in_run(error: impl Iterator<Item = (f64, f64)>, from: f64) -> Vec<(f64, f64)> {
    let points: Vec<_> = error.collect();
    envelope(&points, spread(from, 9500.0, 20), 0.05)
}

fn rows(runs: &Runs) -> [Row; 5] {
    // K is a function of the estimated speed.
    let alone = |seen: &Seen| (seen.estimated_rpm, seen.error_deg);
    let added =
        |(smoothed, alone): (&Seen, &Seen)| (alone.rpm, smoothed.error_deg - alone.error_deg);
    let both = runs.smoothed.iter().zip(&runs.accelerating);
    [
        Row {
            name: "low_pass",
            formula: |rpm| limits::low_pass(tau_int_s(), rad_s(rpm)),
            measured: at_speeds(250.0, 10_000.0, low_pass),
            at_rpm: 1000.0,
            note: "lead of the low-pass, 10 degrees of it at 500 rpm; the drive takes it off",
        },
        Row {
            name: "hold_off",
            formula: |rpm| limits::hold_off(HOLD_OFF_S, rad_s(rpm)),
            measured: at_speeds(250.0, 10_000.0, hold_off),
            at_rpm: 1000.0,
            note: "lag of a crossing that comes together with the one before; 50 us",
        },
        Row {
            name: "extrapolation",
            formula: |rpm| limits::extrapolation(limits::acceleration(N, rad_s(RPM_S), rad_s(rpm))),
            measured: in_run(runs.accelerating.iter().map(alone), 500.0),
            at_rpm: 1000.0,
            note: "greatest lag at 10,000 rpm/s; the drive measures at every edge, which is 7 for \
                   18N - 1 = 17",
        },
        Row {
            name: "position_filter",
            formula: |rpm| limits::position_filter(A_E, N, rad_s(RPM_S), rad_s(rpm)),
            measured: in_run(both.map(added), 2000.0),
            at_rpm: 4000.0,
            note: "greatest lag that A_e = 0.9 adds at 10,000 rpm/s",
        },
        Row {
            name: "digital_delay",
            formula: |rpm| limits::digital_delay(1.0 / SAMPLE_HZ, rad_s(rpm)),
            measured: at_speeds(250.0, 10_000.0, digital_delay),
            at_rpm: 5000.0,
            note: "greatest lag by sampling at 15.625 kHz; the drive takes it off",
        },
    ]
}

/// Interpolates between two measured values around this speed.
fn at(points: &[(f64, f64)], rpm: f64) -> Option<f64> {
    let next = points.iter().position(|(x, _)| *x >= rpm)?;
    let (to, above) = points[next];
    let (from, below) = points[next.checked_sub(1)?];
    Some(below + (above - below) * (rpm - from) / (to - from))
}

/// Table 1.
pub(super) fn table_1(runs: &Runs) -> Reproduction {
    let rows = rows(runs);
    let items = rows.iter().map(|row| {
        let (formula, measured) = ((row.formula)(row.at_rpm), at(&row.measured, row.at_rpm));
        let note = format!("at {:.0} rpm: {}", row.at_rpm, row.note);
        item(
            format!("table1_{}", row.name),
            Some(formula),
            measured,
            "deg",
            note,
        )
    });
    let items = items.collect();
    let lines = rows
        .iter()
        .map(|row| Curve::line(row.name.replace('_', " "), row.measured.clone()));
    let formulas = rows.iter().map(|row| {
        let name = format!("{}, formula", row.name.replace('_', " "));
        Curve::dashed(&name, over(spread(250.0, 10_000.0, 161), row.formula))
    });
    let curves: Vec<Curve> = lines.chain(formulas).collect();
    let (x, y) = (
        ratios("speed (rpm)", 250.0, 10_000.0),
        between("error (electrical degrees)", 0.0, 30.0),
    );
    Reproduction {
        items,
        figures: vec![figure(
            "colton-table-1",
            "Sources of position error (Colton 2014, table 1)",
            1,
            vec![Panel::new(
                "each alone; 14 poles, 15.625 kHz, N = 1, A_e = 0.9",
                x,
                y,
                curves,
            )],
        )],
    }
}
