//! Figures 42 and 43 of the second paper: the scooter's flux observer against the rotor's true angle, in a drive that
//! takes over from a push and accelerates with a constant current.

use std::f64::consts::TAU;

use siskin_control::build::FluxSettings;
use siskin_control::control::observer::limits;
use siskin_control::drive::{Phase, Setpoint};

use super::bench::{Drive, scooter};
use super::sheet::{between, evenly, figure, over};
use crate::plot::chart::{Axis, Curve, Figure, Panel};
use crate::reproduce::item::{Item, Reproduction, item};

/// Torque current, A.
const CURRENT_A: f32 = 20.0;
/// Length of the run, s: up to some 600 rpm.
const RUN_S: f64 = 8.0;
/// Width of the speed steps over which the lead is averaged, rpm.
const STEP_RPM: f64 = 20.0;
/// Speed at which the waveforms are taken, rpm, and their number of turns.
const WAVES_RPM: f64 = 400.0;
const WAVES_TURNS: f64 = 6.0;

/// A sample in Run.
struct Seen {
    rpm: f64,
    /// True electrical angle, turns.
    turns: f64,
    /// λ̂ of the phases, Wb.
    lambda_wb: [f64; 3],
    /// Measured currents of the phases, A.
    currents_a: [f64; 3],
    /// Estimated less true angle, electrical degrees.
    error_deg: f64,
}

/// Runs the push and the acceleration.
fn ride() -> (Vec<Seen>, Drive) {
    let mut drive = scooter();
    let scale = drive.scale();
    let current_a = f64::from(scale.current_a) * 3.0 / 4096.0;
    let mut seen = Vec::new();
    let wanted = Setpoint::Torque(scale.current_from_a(CURRENT_A));
    drive.run(wanted, RUN_S, |_, period, rig| {
        let snapshot = rig.snapshot();
        if snapshot.phase == Phase::Run {
            seen.push(Seen {
                rpm: period.rpm(),
                turns: period.motion.angle_turns,
                lambda_wb: rig.flux_linkages_wb(),
                currents_a: period
                    .sample
                    .currents
                    .map(|i| i.to_num::<f64>() * current_a),
                error_deg: period.angle_error_deg(&snapshot),
            });
        }
    });
    (seen, drive)
}

/// Returns the phasor of a three-phase quantity in the rotor's frame, averaged: along the rotor's flux and across it.
fn phasor<'a>(seen: impl Iterator<Item = &'a Seen>, of: fn(&Seen) -> [f64; 3]) -> (f64, f64) {
    let (mut along, mut across, mut count) = (0.0, 0.0, 0.0);
    for seen in seen {
        for (value, third) in of(seen).iter().zip([0.0, 1.0, -1.0]) {
            let (sin, cos) = libm::sincos(TAU * (third / 3.0 - seen.turns));
            along += value * cos;
            across += value * sin;
        }
        count += 1.5;
    }
    (along / count, across / count)
}

fn degrees((along, across): (f64, f64)) -> f64 {
    libm::atan2(across, along) * 360.0 / TAU
}

/// Returns the lead of the drive's flux integrators by their time constants, degrees.
fn lead_deg(drive: &Drive, rpm: f64) -> f64 {
    let settings = FluxSettings::new(&drive.params);
    let omega_rad_s = rpm * f64::from(drive.motor.pole_pairs) * TAU / 60.0;
    let tau_int_s = f64::from(settings.tau_int_s);
    match settings.tau_hpfs_s {
        None => limits::low_pass(tau_int_s, omega_rad_s),
        Some(tau_s) => limits::second_order(tau_int_s, f64::from(tau_s), omega_rad_s),
    }
}

/// Figure 42: the lead of the observed flux over speed.
fn lead(seen: &[Seen], drive: &Drive) -> (Vec<Item>, Figure) {
    let formula = |rpm: f64| lead_deg(drive, rpm);
    let about = |rpm: f64| {
        let near = move |seen: &&Seen| (seen.rpm - rpm).abs() <= 0.5 * STEP_RPM;
        seen.iter().filter(near)
    };
    let lead = |rpm: f64| {
        about(rpm).next()?;
        Some(degrees(phasor(about(rpm), |seen| seen.lambda_wb)))
    };
    let left = |rpm: f64| {
        let errors: Vec<f64> = about(rpm).map(|seen| seen.error_deg).collect();
        (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64)
    };
    let note = "lead of the observed flux on the true rotor, 11 degrees of it at 100 rpm by its time \
                constants; the formula";
    let items = [180.0, 200.0, 300.0, 400.0, 500.0].map(|rpm| {
        let name = format!("fig42_lead_{rpm:.0}");
        item(name, Some(formula(rpm)), lead(rpm), "deg", note)
    });
    let speeds = || evenly(160.0, 600.0, 23);
    let points = |value: &dyn Fn(f64) -> Option<f64>| {
        let points = speeds().filter_map(|rpm| Some((rpm, value(rpm)?)));
        points.collect::<Vec<_>>()
    };
    let curves = vec![
        Curve::dots("observed flux less true angle", points(&lead)),
        Curve::dashed(
            "sum of 90° - atan(τω)",
            over(evenly(100.0, 600.0, 101), formula),
        ),
        Curve::line("position estimate less true angle", points(&left)),
    ];
    let (x, y) = (
        between("speed (rpm)", 100.0, 600.0),
        between("lead (electrical degrees)", -2.0, 12.0),
    );
    let figure = figure(
        "colton-42",
        "Flux observer's lead at low speed (Colton 2014, figure 42)",
        1,
        vec![Panel::new(
            "scooter, 20 A from a push at 150 rpm",
            x,
            y,
            curves,
        )],
    );
    (items.to_vec(), figure)
}

/// Figure 43: flux of phase a and currents over the rotor's angle.
fn waves(seen: &[Seen], drive: &Drive) -> (Vec<Item>, Figure) {
    let hertz = WAVES_RPM / 60.0 * f64::from(drive.motor.pole_pairs);
    let length = (WAVES_TURNS / hertz / drive.rig.period_s()) as usize;
    let flux_mwb = drive.motor.flux_wb * 1e3;
    let begin = seen.iter().position(|seen| seen.rpm >= WAVES_RPM);
    let waves: Vec<&Seen> = seen
        .iter()
        .skip(begin.unwrap_or(seen.len()))
        .take(length)
        .collect();
    let (lambda, current) = (
        phasor(waves.iter().copied(), |seen| seen.lambda_wb),
        phasor(waves.iter().copied(), |seen| seen.currents_a),
    );
    let amplitude = libm::hypot(lambda.0, lambda.1);
    let items = vec![
        item(
            "fig43_flux",
            Some(flux_mwb),
            amplitude * 1e3,
            "mWb",
            "amplitude of the observed flux; by the motor's torque constant",
        ),
        item(
            "fig43_current_leads_flux",
            Some(90.0),
            degrees(current) - degrees(lambda),
            "deg",
            format!(
                "phase-a current against phase-a flux, which itself leads the rotor by figure 42's \
                 {:.1}",
                lead_deg(drive, WAVES_RPM)
            ),
        ),
    ];
    let over_angle = |value: &dyn Fn(&Seen) -> f64| -> Vec<(f64, f64)> {
        let points = waves.iter().map(|seen| (seen.turns * 360.0, value(seen)));
        points.collect()
    };
    let angle = || Axis {
        range: Some((0.0, 360.0)),
        ..Axis::new("rotor electrical angle (degrees)")
    };
    let truth = |degrees: f64| flux_mwb * libm::cos(degrees * TAU / 360.0);
    let flux = vec![
        Curve::dots(
            "observed, phase a",
            over_angle(&|seen| seen.lambda_wb[0] * 1e3),
        ),
        Curve::dashed("rotor's", over(evenly(0.0, 360.0, 181), truth)),
    ];
    let currents = ["a", "b", "c"]
        .into_iter()
        .enumerate()
        .map(|(phase, name)| {
            let points = over_angle(&|seen| seen.currents_a[phase]);
            Curve::dots(format!("phase {name}"), points)
        });
    let currents = currents.collect();
    let figure = figure(
        "colton-43",
        "Scooter's flux and currents (Colton 2014, figure 43)",
        1,
        vec![
            Panel::new(
                "flux linkage, six turns at 400 rpm",
                angle(),
                between("flux linkage (mWb)", -15.0, 15.0),
                flux,
            ),
            Panel::new(
                "measured currents",
                angle(),
                between("current (A)", -25.0, 25.0),
                currents,
            ),
        ],
    );
    (items, figure)
}

/// Figures 42 and 43.
pub(super) fn waveforms() -> Reproduction {
    let (seen, drive) = ride();
    let parts = [lead(&seen, &drive), waves(&seen, &drive)];
    let (items, figures): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
    Reproduction {
        items: items.concat(),
        figures,
    }
}
