//! Figures 19, 20 and 21 of the second paper: how the running flux integrator departs from an ideal
//! integrator.

use std::f64::consts::TAU;

use siskin_control::control::observer::flux_linkage;
use siskin_control::control::observer::limits;
use siskin_units::{Angle, Current, FLUX_NOMINAL, Speed};

use super::estimator::{SAMPLE_HZ, fluxes, integrator, rad_s, voltages};
use super::sheet::{between, figure, over, ratios, spread};
use crate::plot::chart::{Curve, Figure, Panel};
use crate::reproduce::item::{Item, Reproduction, item};

/// The paper's allowed lead, degrees.
const LEAD_DEG: f64 = 10.0;
/// The speed above which the filters of figures 20 and 21 lead by less, rpm. The paper does not
/// print its own.
const LEAST_RPM: f64 = 500.0;
/// τ_HPFS over τ_int, "much above 1": the drive's.
const SHARE: f64 = 10.0;

/// A flux integrator's response to a turning rotor's voltages.
struct Response {
    /// Its amplitude over an integrator's.
    gain: f64,
    /// Its lead over an integrator, degrees.
    lead_deg: f64,
}

/// Turns the rotor at ω for one turn, and measures over the next two.
fn respond(tau_int_s: f64, tau_hpfs_s: Option<f64>, omega_rad_s: f64) -> Response {
    let config = integrator(tau_int_s, tau_hpfs_s);
    let step = omega_rad_s / TAU / SAMPLE_HZ;
    let still = [Current::ZERO; 3];
    let mut state = flux_linkage::State::default();
    flux_linkage::begin(
        &config,
        &mut state,
        Angle::ZERO,
        Speed::from_num(step),
        still,
    );
    let a_turn = (1.0 / step).ceil() as u32;
    let mut before = fluxes(0.0);
    // The fluxes as a vector in the rotor's frame.
    let (mut along, mut across) = (0.0, 0.0);
    for sample in 1..=3 * a_turn {
        let turns = step * f64::from(sample);
        let now = fluxes(turns);
        flux_linkage::advance(&config, &mut state, voltages(before, now), still);
        before = now;
        if sample > a_turn {
            for (lambda, third) in state.lambda.iter().zip([0.0, 1.0, -1.0]) {
                let (sin, cos) = libm::sincos(TAU * (third / 3.0 - turns));
                along += lambda.to_num::<f64>() * cos;
                across += lambda.to_num::<f64>() * sin;
            }
        }
    }
    let ideal = 1.5 * FLUX_NOMINAL.to_num::<f64>() * f64::from(2 * a_turn);
    Response {
        gain: libm::hypot(along, across) / ideal,
        lead_deg: libm::atan2(across, along) * 360.0 / TAU,
    }
}

/// Figure 19: the least time constant over the speed.
fn time_constants() -> (Vec<Item>, Figure) {
    let needed = |rpm: f64| 1e3 * limits::tau_int_s(LEAD_DEG, rad_s(rpm));
    let speeds = [100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0, 10_000.0];
    let found = speeds.map(|rpm| (rpm, 1e3 * least_tau_s(rad_s(rpm))));
    let items = found.map(|(rpm, tau_ms)| {
        item(
            format!("fig19_tau_int_{rpm:.0}"),
            Some(needed(rpm)),
            tau_ms,
            "ms",
            format!("least time constant that leads by 10 degrees or less from {rpm:.0} rpm"),
        )
    });
    let curves = vec![
        Curve::dots("running integrator", found.to_vec()),
        Curve::dashed("5.671/ω", over(spread(100.0, 10_000.0, 101), needed)),
    ];
    let (x, y) = (
        ratios("speed (rpm)", 100.0, 10_000.0),
        ratios("time constant of the integrator (ms)", 0.5, 100.0),
    );
    let figure = figure(
        "colton-19",
        "Least time constant for 10° of lead (Colton 2014, figure 19)",
        1,
        vec![Panel::new("14 poles", x, y, curves)],
    );
    (items.to_vec(), figure)
}

/// Finds the time constant at which the running integrator leads by 10° at this speed.
fn least_tau_s(omega_rad_s: f64) -> f64 {
    let (mut short, mut long) = (1.0 / omega_rad_s, 50.0 / omega_rad_s);
    for _ in 0..20 {
        let middle = 0.5 * (short + long);
        if respond(middle, None, omega_rad_s).lead_deg > LEAD_DEG {
            short = middle;
        } else {
            long = middle;
        }
    }
    long
}

/// The two forms that figures 20 and 21 compare.
#[derive(Clone, Copy)]
struct Form {
    name: &'static str,
    tau_int_s: f64,
    tau_hpfs_s: Option<f64>,
}

impl Form {
    fn both() -> [Self; 2] {
        let tau_int_s = limits::tau_int_s(LEAD_DEG, rad_s(LEAST_RPM));
        [
            ("first order", None),
            ("second order", Some(SHARE * tau_int_s)),
        ]
        .map(|(name, tau_hpfs_s)| Self {
            name,
            tau_int_s,
            tau_hpfs_s,
        })
    }

    fn respond(&self, omega_rad_s: f64) -> Response {
        respond(self.tau_int_s, self.tau_hpfs_s, omega_rad_s)
    }

    fn lead_deg(&self, omega_rad_s: f64) -> f64 {
        match self.tau_hpfs_s {
            None => limits::low_pass(self.tau_int_s, omega_rad_s),
            Some(tau_s) => limits::second_order(self.tau_int_s, tau_s, omega_rad_s),
        }
    }

    /// Returns the amplitude over an integrator's: a high-pass's for each time constant.
    fn gain(&self, omega_rad_s: f64) -> f64 {
        let high_pass = |tau_s: f64| {
            let x = tau_s * omega_rad_s;
            x / libm::sqrt(1.0 + x * x)
        };
        high_pass(self.tau_int_s) * self.tau_hpfs_s.map_or(1.0, high_pass)
    }
}

fn decibel(gain: f64) -> f64 {
    20.0 * libm::log10(gain)
}

/// Figure 20: magnitude and phase over frequency.
fn bode() -> (Vec<Item>, Figure) {
    let (from, to) = (0.1, 1000.0);
    let rad_s = |hertz: f64| TAU * hertz;
    let mut items = Vec::new();
    let mut magnitudes = Vec::new();
    let mut phases = Vec::new();
    let every = || spread(from, to, 101);
    let integral = |hertz: f64| decibel(1.0 / rad_s(hertz));
    for form in Form::both() {
        let places = spread(1.0, to, 16);
        let seen: Vec<_> = places
            .map(|hertz| (hertz, form.respond(rad_s(hertz))))
            .collect();
        let magnitude = seen
            .iter()
            .map(|(hertz, seen)| (*hertz, integral(*hertz) + decibel(seen.gain)));
        let phase = seen
            .iter()
            .map(|(hertz, seen)| (*hertz, seen.lead_deg - 90.0));
        magnitudes.push(Curve::dots(format!("{}, running", form.name), magnitude));
        phases.push(Curve::dots(format!("{}, running", form.name), phase));
        let magnitude = |hertz: f64| integral(hertz) + decibel(form.gain(rad_s(hertz)));
        magnitudes.push(Curve::line(form.name, over(every(), magnitude)));
        let phase = |hertz: f64| form.lead_deg(rad_s(hertz)) - 90.0;
        phases.push(Curve::line(form.name, over(every(), phase)));
        let corner = 1.0 / form.tau_int_s;
        let at_corner = form.respond(corner);
        let short = form.name.replace(' ', "_");
        items.push(item(
            format!("fig20_gain_{short}"),
            Some(decibel(form.gain(corner))),
            decibel(at_corner.gain),
            "dB",
            "against an integrator, at the corner 1/tau_int",
        ));
        items.push(item(
            format!("fig20_phase_{short}"),
            Some(form.lead_deg(corner) - 90.0),
            at_corner.lead_deg - 90.0,
            "deg",
            "at the corner 1/tau_int; an integrator has -90",
        ));
    }
    magnitudes.push(Curve::dashed("integrator", over(every(), integral)));
    phases.push(Curve::dashed("integrator", over(every(), |_| -90.0)));
    let frequency = || ratios("frequency (Hz)", from, to);
    let figure = figure(
        "colton-20",
        "Integrator, low-pass and second-order filter (Colton 2014, figure 20)",
        1,
        vec![
            Panel::new(
                "magnitude",
                frequency(),
                between("magnitude (dB s)", -80.0, 20.0),
                magnitudes,
            ),
            Panel::new(
                "phase",
                frequency(),
                between("phase (degrees)", -100.0, 100.0),
                phases,
            ),
        ],
    );
    (items, figure)
}

/// Figure 21: the lead of both forms over speed.
fn leads() -> (Vec<Item>, Figure) {
    let mut items = Vec::new();
    let mut curves = Vec::new();
    for form in Form::both() {
        let rows = [250.0, 500.0, 1000.0, 2000.0];
        let short = form.name.replace(' ', "_");
        items.extend(rows.map(|rpm| {
            let measured = form.respond(rad_s(rpm)).lead_deg;
            item(
                format!("fig21_lead_{short}_{rpm:.0}"),
                Some(form.lead_deg(rad_s(rpm))),
                measured,
                "deg",
                format!(
                    "lead at {rpm:.0} rpm, 10 degrees of it at 500 rpm by tau_int; the formula"
                ),
            )
        }));
        let seen = spread(100.0, 3000.0, 24).map(|rpm| (rpm, form.respond(rad_s(rpm)).lead_deg));
        curves.push(Curve::dots(format!("{}, running", form.name), seen));
        let formula = |rpm: f64| form.lead_deg(rad_s(rpm));
        curves.push(Curve::line(
            form.name,
            over(spread(100.0, 3000.0, 101), formula),
        ));
    }
    let (x, y) = (
        between("speed (rpm)", 0.0, 3000.0),
        between("phase lead (degrees)", 0.0, 60.0),
    );
    let figure = figure(
        "colton-21",
        "Phase lead of both forms (Colton 2014, figure 21)",
        1,
        vec![Panel::new("14 poles, τ_HPFS = 10 τ_int", x, y, curves)],
    );
    (items, figure)
}

/// Figures 19, 20 and 21.
pub(super) fn filters() -> Reproduction {
    let parts = [time_constants(), bode(), leads()];
    let (items, figures): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
    Reproduction {
        items: items.concat(),
        figures,
    }
}
