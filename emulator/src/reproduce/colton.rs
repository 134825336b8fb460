//! Figures 27, 28 and 30 of the second paper: the error of the position estimator while a motor
//! accelerates, beside the bounds that the paper gives in closed form.
//!
//! The running estimator is fed with the voltages of an ideal motor without resistance and
//! inductance, so that its integrators, which here forget nothing, hold the ideal flux.
//!
//! The paper measures the speed once in N turns and bounds the error of the last interval before the
//! next measurement. The estimator measures at every edge, and stays well below that bound where the
//! acceleration counts.

use std::f64::consts::TAU;
use std::ops::RangeInclusive;

use siskin_control::control::delay::Delay;
use siskin_control::control::observer;
use siskin_control::control::observer::edges::{self, Sensors};
use siskin_control::control::observer::{crossing, flux_linkage, position};
use siskin_control::math::Gain;
use siskin_control::params::{ParamId, Params, build};
use siskin_control::units::{Angle, Current, Speed, Voltage};

use super::{Item, Reproduction};
use crate::rig::Bench;

/// 14 poles.
const POLE_PAIRS: f64 = 7.0;
/// Acceleration, mechanical rpm/s.
const RPM_S: f64 = 10_000.0;
/// Speed at the end, mechanical rpm.
const RPM_END: f64 = 10_000.0;
/// Sampling frequency, Hz.
const SAMPLE_HZ: f64 = 15_625.0;
/// N, electrical turns a measurement of the speed.
const N: f64 = 1.0;
/// A, the angle between two crossings, turns.
const A: f64 = 1.0 / 6.0;
/// A_e of figure 30.
const A_E: f64 = 0.9;
/// Angles at which the rotor starts; a sixth of a turn later all repeats but for the phase.
const STARTS: u32 = 60;

/// α in electrical turns/s².
const ALPHA: f64 = RPM_S / 60.0 * POLE_PAIRS;

/// Speeds of the tables' rows, mechanical rpm, each standing for what is within 5 % of it.
const ROWS: [f64; 9] = [
    250.0, 500.0, 750.0, 1000.0, 2000.0, 3400.0, 5000.0, 7300.0, 9500.0,
];

/// A sample of a run.
struct Seen {
    /// True mechanical speed, rpm.
    rpm: f64,
    /// Estimated mechanical speed, rpm.
    estimated_rpm: f64,
    /// Magnitude of estimated less true angle, electrical degrees.
    error_deg: f64,
    /// What the paper bounds it by.
    bound_deg: f64,
}

/// The bound by acceleration, θ_ex (appendix A), degrees; `omega` is the estimate in turns/s.
fn theta_ex(omega: f64) -> f64 {
    let k = (18.0 * N - 1.0) * ALPHA * A / (omega * omega);
    // Without an estimate K is infinite, and the bound all of A.
    (1.0 - 1.0 / libm::sqrt(1.0 + k)) * A * 360.0
}

/// The bound by sampling, θ_es = ω·T_s (2.4.1), degrees.
fn theta_es(omega: f64) -> f64 {
    omega / SAMPLE_HZ * 360.0
}

/// The approximate bound by the filter, θ_ef (2.4.2), degrees.
fn theta_ef(omega: f64, a_e: f64) -> f64 {
    if a_e == 0.0 {
        return 0.0;
    }
    ALPHA * A / (omega * omega) * (a_e / (1.0 - a_e)) * 6.0 * N * A * 360.0
}

/// What is switched in a run.
struct Setting {
    a_e: f64,
    /// Whether the time from a crossing to its sample is taken into account, which leaves what
    /// acceleration alone does.
    compensates: bool,
}

impl Setting {
    fn bound_deg(&self, estimated: f64, omega: f64) -> f64 {
        let sampling = if self.compensates {
            0.0
        } else {
            theta_es(omega)
        };
        theta_ex(estimated) + theta_ef(estimated, self.a_e) + sampling
    }

    /// The estimator of the paper: what the drive does beyond it is turned off.
    fn estimator(&self) -> edges::Config {
        let mut params = Params::default();
        for (id, value) in [
            (ParamId::MotPolePairs, POLE_PAIRS),
            (ParamId::PwmFreqHz, SAMPLE_HZ),
            (ParamId::CtlObserver, 1.0),
            (ParamId::CtlPosN, N),
            (ParamId::CtlAe, self.a_e),
        ] {
            params.set(id, value as f32).expect("within the table");
        }
        let board = Bench::default().sensing.board(Delay::One);
        let built = build(&params, &board).expect("the defaults fit, and 0.075 turns a period");
        let observer::Config::Edges(edges) = built.observer else {
            unreachable!("CTL_OBSERVER is 1");
        };
        edges::Config {
            sensors: Sensors::None,
            flux: flux_linkage::Config {
                forget: Gain::ZERO,
                corner: Speed::ZERO,
                high_pass: None,
                ..edges.flux
            },
            crossing: crossing::Config {
                deadband: Angle::ZERO,
                deadband_angle: Angle::ZERO,
                patience: u32::MAX,
                ..edges.crossing
            },
            position: position::Config {
                whole_turns_above: Speed::ZERO,
                filter_above: Speed::ZERO,
                compensates: self.compensates,
                ..edges.position
            },
            ..edges
        }
    }

    /// Every sample from standstill to the end, for each starting angle.
    fn run(&self) -> Vec<Seen> {
        let config = self.estimator();
        let starts = (0..STARTS).map(|start| f64::from(start) / f64::from(STARTS) / 6.0);
        starts
            .flat_map(|start| accelerate(self, &config, start))
            .collect()
    }
}

/// One start, from this angle in turns.
fn accelerate(setting: &Setting, config: &edges::Config, start: f64) -> Vec<Seen> {
    let flux = flux_linkage::NOMINAL.to_num::<f64>();
    let fluxes =
        |turns: f64| [0.0, -1.0, 1.0].map(|third| flux * libm::cos(TAU * (turns + third / 3.0)));
    let still = [Current::ZERO; 3];
    let mut state = edges::State::default();
    edges::begin(
        config,
        &mut state,
        Angle::wrapping_from_num(start),
        Speed::ZERO,
        still,
    );
    let samples = (RPM_END / RPM_S * SAMPLE_HZ) as u32;
    let mut before = fluxes(start);
    let mut seen = Vec::new();
    for sample in 1..=samples {
        let time_s = f64::from(sample) / SAMPLE_HZ;
        let turns = start + 0.5 * ALPHA * time_s * time_s;
        let now = fluxes(turns);
        // A period's voltage is the change of the flux, in the control's units.
        let v = [0, 1, 2].map(|phase| Voltage::from_num(now[phase] - before[phase]));
        before = now;
        let got = edges::estimate(config, &mut state, v, still, 0);
        let error = got.theta.wrapping_sub(Angle::wrapping_from_num(turns));
        let (omega, estimated) = (ALPHA * time_s, got.omega.to_num::<f64>() * SAMPLE_HZ);
        seen.push(Seen {
            rpm: omega * 60.0 / POLE_PAIRS,
            estimated_rpm: estimated * 60.0 / POLE_PAIRS,
            error_deg: error.to_num::<f64>().abs() * 360.0,
            bound_deg: setting.bound_deg(estimated, omega),
        });
    }
    seen
}

fn greatest(values: impl Iterator<Item = f64>) -> Option<f64> {
    values.reduce(f64::max)
}

/// The greatest error within a range of true speeds.
fn error_within(seen: &[Seen], rpm: RangeInclusive<f64>) -> Option<f64> {
    let within = seen.iter().filter(|seen| rpm.contains(&seen.rpm));
    greatest(within.map(|seen| seen.error_deg))
}

/// A table: per row the greatest bound and the greatest error about the speed.
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
        Item {
            name: format!("{name}_error_{rpm:.0}"),
            paper: greatest(about.iter().map(|seen| seen.bound_deg)),
            measured: greatest(about.iter().map(|seen| seen.error_deg)),
            unit: "deg",
            note: format!("greatest error within 5 % of {rpm:.0} rpm; the printed bound"),
        }
    })
    .collect()
}

/// How much of its bound the error takes, at most.
fn of_bound(name: &str, seen: &[Seen], from_rpm: f64, note: &str) -> Item {
    let shares = seen
        .iter()
        .filter(|seen| seen.rpm >= from_rpm)
        .map(|seen| 100.0 * seen.error_deg / seen.bound_deg);
    Item {
        name: format!("{name}_of_bound"),
        paper: Some(100.0),
        measured: greatest(shares),
        unit: "%",
        note: note.to_owned(),
    }
}

fn limit(name: &str, seen: &[Seen], paper: f64, from_rpm: f64, to_rpm: f64) -> Item {
    Item {
        name: name.to_owned(),
        paper: Some(paper),
        measured: error_within(seen, from_rpm..=to_rpm),
        unit: "deg",
        note: format!("greatest error from {from_rpm:.0} to {to_rpm:.0} rpm; the paper's limit"),
    }
}

/// Figures 27, 28 and 30.
pub fn colton() -> Reproduction {
    let mut items = Vec::new();

    let accelerating = Setting {
        a_e: 0.0,
        compensates: true,
    };
    let seen = accelerating.run();
    // The figure's own axis is the estimated speed. Above, less than half a degree is left of the
    // bound, and a fifth of one comes from the line through the two samples about a crossing.
    items.extend(rows(
        "fig27",
        &seen,
        |seen| seen.estimated_rpm,
        0.0..=3400.0,
    ));

    let unfiltered = Setting {
        a_e: 0.0,
        compensates: false,
    };
    let seen = unfiltered.run();
    items.extend(rows("fig28", &seen, |seen| seen.rpm, 500.0..=RPM_END));
    items.push(limit(
        "fig28_error_1000_to_3400",
        &seen,
        10.0,
        1000.0,
        3400.0,
    ));
    items.push(limit("fig28_error_500_to_7300", &seen, 20.0, 500.0, 7300.0));
    items.push(of_bound(
        "fig28",
        &seen,
        0.0,
        "greatest share of the bound by acceleration and sampling, from standstill",
    ));

    let filtered = Setting {
        a_e: A_E,
        compensates: false,
    };
    let seen = filtered.run();
    items.extend(rows("fig30", &seen, |seen| seen.rpm, 2000.0..=RPM_END));
    items.push(limit("fig30_error_from_2000", &seen, 20.0, 2000.0, RPM_END));
    items.push(of_bound(
        "fig30",
        &seen,
        2000.0,
        "greatest share of the bound with the filter's part, where the paper holds it valid",
    ));
    Reproduction { items }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(reproduction: &Reproduction, name: &str) -> f64 {
        let item = reproduction.find(name).expect("an item of this name");
        item.measured.expect("it was measured")
    }

    #[test]
    fn the_bounds_are_those_that_the_paper_prints() {
        let omega = |rpm: f64| rpm / 60.0 * POLE_PAIRS;
        // Below 10° above 750 rpm (figure 27).
        assert!(theta_ex(omega(750.0)) < 10.0 && theta_ex(omega(735.0)) > 10.0);
        let both = |rpm: f64| theta_ex(omega(rpm)) + theta_es(omega(rpm));
        // About 1,000 to 3,400 rpm below 10°, 500 to 7,300 rpm below 20° (figure 28).
        for (rpm, most) in [
            (1000.0, 10.0),
            (3400.0, 10.0),
            (500.0, 20.0),
            (7300.0, 20.0),
        ] {
            assert!(both(rpm) < most, "{rpm}");
        }
        // 20° with the filter at 2,000 rpm (figure 30).
        assert!((both(2000.0) + theta_ef(omega(2000.0), A_E) - 18.7).abs() < 0.1);
        assert_eq!(theta_ex(0.0), 60.0);
    }

    #[test]
    fn the_errors_are_within_the_papers_bounds_and_limits() {
        let reproduction = colton();
        for (name, most) in [
            ("fig28_of_bound", 100.0),
            ("fig28_error_1000_to_3400", 10.0),
            ("fig28_error_500_to_7300", 20.0),
            ("fig30_of_bound", 100.0),
            ("fig30_error_from_2000", 20.0),
        ] {
            let got = measured(&reproduction, name);
            assert!(got > 0.0 && got < most, "{name}: {got}");
        }
        for item in &reproduction.items {
            let (paper, got) = (
                item.paper.expect(&item.name),
                item.measured.expect(&item.name),
            );
            assert!(got < paper, "{}: {got} of {paper}", item.name);
        }
    }

    #[test]
    fn the_tables_are_json_without_a_gap() {
        let value = serde_json::to_value(colton()).expect("numbers and text");
        let items = value["items"].as_array().expect("a list");
        assert!(items.len() > 15);
        for item in items {
            for key in ["paper", "measured"] {
                assert!(item[key].is_f64(), "{item}");
            }
            for key in ["name", "unit", "note"] {
                assert!(item[key].is_string(), "{item}");
            }
        }
    }
}
