//! Figures 27, 28, 30 and 54 of the second paper: the position estimator's error while a motor
//! accelerates, and the bounds that the paper gives in closed form.
//!
//! The paper measures the speed once in N turns and bounds the error of the last interval before
//! the next measurement. The estimator measures at every edge, and stays well below that bound
//! where acceleration dominates.

use std::ops::RangeInclusive;

use siskin_control::control::observer::limits;

use super::estimator::{N, SAMPLE_HZ, begun, config, follow, hz, rad_s};
use super::sheet::{between, evenly, figure, over};
use crate::plot::chart::{Axis, Curve, Figure, Panel};
use crate::reproduce::item::{Item, Reproduction, item};

/// Acceleration, mechanical rpm/s.
pub(super) const RPM_S: f64 = 10_000.0;
/// Speed at the end, mechanical rpm.
pub(super) const RPM_END: f64 = 10_000.0;
/// A_e of figure 30.
pub(super) const A_E: f64 = 0.9;
/// Initial rotor angles; a sixth of a turn later everything repeats but for the phase.
const STARTS: u32 = 60;

/// K at which the error is 10° (appendix A).
const K_PRINTED: f64 = 0.44;
/// Steps of a picture.
const STEPS: usize = 200;

/// Speeds of the tables' rows, mechanical rpm, each covering 5 % to either side.
const ROWS: [f64; 9] = [
    250.0, 500.0, 750.0, 1000.0, 2000.0, 3400.0, 5000.0, 7300.0, 9500.0,
];

/// A sample of a run.
#[derive(Clone, Copy)]
pub(super) struct Seen {
    /// True mechanical speed, rpm.
    pub(super) rpm: f64,
    /// Estimated mechanical speed, rpm.
    pub(super) estimated_rpm: f64,
    /// Magnitude of estimated less true angle, electrical degrees.
    pub(super) error_deg: f64,
    /// The paper's bound on it.
    bound_deg: f64,
}

/// What varies between runs.
#[derive(Clone, Copy)]
pub(super) struct Setting {
    a_e: f64,
    /// Whether the time from a crossing to its sample is compensated, which leaves the effect of
    /// acceleration alone.
    compensates: bool,
}

impl Setting {
    /// Figure 27: acceleration alone.
    const ACCELERATING: Self = Self {
        a_e: 0.0,
        compensates: true,
    };
    /// Figure 28: with sampling.
    const SAMPLED: Self = Self {
        a_e: 0.0,
        compensates: false,
    };
    /// Acceleration with the position filter.
    const SMOOTHED: Self = Self {
        a_e: A_E,
        compensates: true,
    };
    /// Figure 30: with sampling and the position filter.
    const FILTERED: Self = Self {
        a_e: A_E,
        compensates: false,
    };

    fn bound_deg(&self, estimated_rpm: f64, rpm: f64) -> f64 {
        let sampling = if self.compensates {
            0.0
        } else {
            limits::digital_delay(1.0 / SAMPLE_HZ, rad_s(rpm))
        };
        let k = limits::acceleration(N, rad_s(RPM_S), rad_s(estimated_rpm));
        let filter = limits::position_filter(self.a_e, N, rad_s(RPM_S), rad_s(rpm));
        limits::extrapolation(k) + filter + sampling
    }

    /// Returns every sample from standstill to the end, for each starting angle.
    fn run(&self) -> Vec<Seen> {
        let config = config(self.a_e, self.compensates);
        let samples = (RPM_END / RPM_S * SAMPLE_HZ) as u32;
        let starts = (0..STARTS).map(|start| f64::from(start) / f64::from(STARTS) / 6.0);
        let seen = starts.flat_map(|start| {
            let angle = move |time_s: f64| start + 0.5 * hz(RPM_S) * time_s * time_s;
            follow(&config, begun(&config, start, 0.0), angle, samples)
        });
        seen.map(|said| {
            let (rpm, estimated_rpm) = (RPM_S * said.time_s, said.omega_hz / hz(1.0));
            Seen {
                rpm,
                estimated_rpm,
                error_deg: said.error_deg.abs(),
                bound_deg: self.bound_deg(estimated_rpm, rpm),
            }
        })
        .collect()
    }
}

/// The runs of the figures and of Table 1; their samples are simultaneous.
pub(super) struct Runs {
    pub(super) accelerating: Vec<Seen>,
    pub(super) smoothed: Vec<Seen>,
    sampled: Vec<Seen>,
    filtered: Vec<Seen>,
}

impl Runs {
    /// Runs all of them.
    pub(super) fn new() -> Self {
        let both =
            |one: Setting, other: Setting| rayon::join(move || one.run(), move || other.run());
        let ((accelerating, smoothed), (sampled, filtered)) = rayon::join(
            || both(Setting::ACCELERATING, Setting::SMOOTHED),
            || both(Setting::SAMPLED, Setting::FILTERED),
        );
        Self {
            accelerating,
            smoothed,
            sampled,
            filtered,
        }
    }
}

pub(super) fn greatest(values: impl Iterator<Item = f64>) -> Option<f64> {
    values.reduce(f64::max)
}

/// Returns the greatest of a quantity around each of these places, within this share of it.
pub(super) fn envelope(
    points: &[(f64, f64)],
    places: impl Iterator<Item = f64>,
    within: f64,
) -> Vec<(f64, f64)> {
    let greatest_about = |place: f64| {
        let about = points
            .iter()
            .filter(|(x, _)| (x / place - 1.0).abs() <= within);
        Some((place, greatest(about.map(|(_, y)| *y))?))
    };
    places.filter_map(greatest_about).collect()
}

/// Tabulates the greatest bound and the greatest error around each row's speed.
fn rows(
    name: &str,
    seen: &[Seen],
    speed: fn(&Seen) -> f64,
    range_rpm: RangeInclusive<f64>,
) -> Vec<Item> {
    let rows = ROWS.into_iter().filter(|rpm| range_rpm.contains(rpm));
    rows.map(|rpm| {
        let about: Vec<&Seen> = seen
            .iter()
            .filter(|seen| (speed(seen) / rpm - 1.0).abs() <= 0.05)
            .collect();
        item(
            format!("{name}_error_{rpm:.0}"),
            greatest(about.iter().map(|seen| seen.bound_deg)),
            greatest(about.iter().map(|seen| seen.error_deg)),
            "deg",
            format!("greatest error within 5 % of {rpm:.0} rpm; the printed bound"),
        )
    })
    .collect()
}

/// Returns the greatest share of its bound that the error takes.
fn of_bound(name: &str, seen: &[Seen], from_rpm: f64, note: &str) -> Item {
    let shares = seen
        .iter()
        .filter(|seen| seen.rpm >= from_rpm)
        .map(|seen| 100.0 * seen.error_deg / seen.bound_deg);
    let name = format!("{name}_of_bound");
    item(name, Some(100.0), greatest(shares), "%", note)
}

fn limit(name: &str, seen: &[Seen], paper: f64, (from_rpm, to_rpm): (f64, f64)) -> Item {
    let within = seen
        .iter()
        .filter(|seen| (from_rpm..=to_rpm).contains(&seen.rpm));
    let error = greatest(within.map(|seen| seen.error_deg));
    let note = format!("greatest error from {from_rpm:.0} to {to_rpm:.0} rpm; the paper's limit");
    item(name, Some(paper), error, "deg", note)
}

/// Draws the greatest error and the greatest bound over the speed, of all starts.
fn picture(name: &str, title: &str, seen: &[Seen], speed: fn(&Seen) -> f64, x: Axis) -> Figure {
    let (from, to) = x.range.unwrap_or((0.0, RPM_END));
    let step = (to - from) / STEPS as f64;
    let mut steps = [(f64::NAN, f64::NAN); STEPS];
    for seen in seen {
        let index = (speed(seen) - from) / step;
        if (0.0..STEPS as f64).contains(&index) {
            let (error, bound) = &mut steps[index as usize];
            *error = error.max(seen.error_deg);
            *bound = bound.max(seen.bound_deg);
        }
    }
    let middles = evenly(from + 0.5 * step, to - 0.5 * step, STEPS as u32);
    let (errors, bounds): (Vec<_>, Vec<_>) = middles
        .zip(steps)
        .map(|(rpm, (error, bound))| ((rpm, error), (rpm, bound)))
        .unzip();
    let curves = vec![
        Curve::line("greatest error of 60 starts", errors),
        Curve::dashed("the paper's bound", bounds),
    ];
    let y = between("position error (electrical degrees)", 0.0, 60.0);
    let panel = Panel::new("14 poles, 10,000 rpm/s, 15.625 kHz, N = 1", x, y, curves);
    figure(name, title, 1, vec![panel])
}

/// Figures 27, 28 and 30.
pub(super) fn over_speed(runs: &Runs) -> Reproduction {
    let Runs {
        accelerating,
        sampled,
        filtered,
        ..
    } = runs;
    // The figure's own axis is the estimated speed. Above, less than half a degree is left of the
    // bound, and a fifth of one comes from the line through the two samples around a crossing.
    let mut items = rows(
        "fig27",
        accelerating,
        |seen| seen.estimated_rpm,
        0.0..=3400.0,
    );
    items.extend(rows("fig28", sampled, |seen| seen.rpm, 500.0..=RPM_END));
    items.push(limit(
        "fig28_error_1000_to_3400",
        sampled,
        10.0,
        (1000.0, 3400.0),
    ));
    items.push(limit(
        "fig28_error_500_to_7300",
        sampled,
        20.0,
        (500.0, 7300.0),
    ));
    items.push(of_bound(
        "fig28",
        sampled,
        0.0,
        "greatest share of the bound by acceleration and sampling, from standstill",
    ));
    items.extend(rows("fig30", filtered, |seen| seen.rpm, 2000.0..=RPM_END));
    items.push(limit(
        "fig30_error_from_2000",
        filtered,
        20.0,
        (2000.0, RPM_END),
    ));
    items.push(of_bound(
        "fig30",
        filtered,
        2000.0,
        "greatest share of the bound with the filter's part, where the paper holds it valid",
    ));
    let speed = || between("speed (rpm)", 0.0, RPM_END);
    Reproduction {
        items,
        figures: vec![
            picture(
                "colton-27",
                "Position error by acceleration (Colton 2014, figure 27)",
                accelerating,
                |seen| seen.estimated_rpm,
                between("estimated speed (rpm)", 0.0, 3000.0),
            ),
            picture(
                "colton-28",
                "Position error by acceleration and sampling (Colton 2014, figure 28)",
                sampled,
                |seen| seen.rpm,
                speed(),
            ),
            picture(
                "colton-30",
                "Position error with the filter, A_e = 0.9 (Colton 2014, figure 30)",
                filtered,
                |seen| seen.rpm,
                speed(),
            ),
        ],
    }
}

/// Figure 54: the worst case over K.
pub(super) fn over_k(runs: &Runs) -> Reproduction {
    let by_k: Vec<(f64, f64)> = runs
        .accelerating
        .iter()
        .map(|seen| {
            let omega = rad_s(seen.estimated_rpm);
            (limits::acceleration(N, rad_s(RPM_S), omega), seen.error_deg)
        })
        .filter(|(k, _)| k.is_finite())
        .collect();
    let measured = envelope(&by_k, evenly(0.02, 2.0, 100), 0.02);
    let ten = measured.iter().find(|(_, error_deg)| *error_deg > 10.0);
    let at_paper = envelope(&by_k, std::iter::once(K_PRINTED), 0.02);
    let mut shown = measured.clone();
    shown.retain(|(k, _)| (k * 10.0 - libm::round(k * 10.0)).abs() < 1e-6);
    let curves = vec![
        Curve::dots("running estimator, greatest error", shown),
        Curve::dashed(
            "(1 - 1/sqrt(1 + K)) 60",
            over(evenly(0.0, 2.0, 201), limits::extrapolation),
        ),
    ];
    let (x, y) = (
        between("dimensionless acceleration K", 0.0, 2.0),
        between("position error (electrical degrees)", 0.0, 30.0),
    );
    Reproduction {
        items: vec![
            item(
                "fig54_k_for_10_deg",
                Some(K_PRINTED),
                ten.map(|(k, _)| *k),
                "",
                "K at which the error comes to 10 degrees; the running estimator measures the speed at \
                 every edge, for which 18N - 1 = 17 is 7",
            ),
            item(
                "fig54_error_at_0.44",
                Some(10.0),
                at_paper.first().map(|(_, error_deg)| *error_deg),
                "deg",
                "greatest error at that K; the formula",
            ),
        ],
        figures: vec![figure(
            "colton-54",
            "Worst-case position error over K (Colton 2014, figure 54)",
            1,
            vec![Panel::new("from standstill at 10,000 rpm/s", x, y, curves)],
        )],
    }
}
