//! Figure 7: power, losses and efficiency of the drives without a position sensor.

use rayon::prelude::*;

use super::foc::{Foc, Modulation};
use super::means::Means;
use super::sensorless::{Drive, Realism};
use super::setting::load_nm;
use super::six_step::SixStep;
use crate::plot::chart::{Axis, Curve, Figure, PANEL, Panel};
use crate::reproduce::item::{Item, item};

/// Speeds of the figure, rpm.
const SPEEDS_RPM: [f64; 8] = [
    2500.0, 3000.0, 3500.0, 4000.0, 4500.0, 5000.0, 5500.0, 6000.0,
];

/// Improvements of the motor's efficiency printed in the paper, points.
const PRINTED: [(f64, f64); 3] = [(3000.0, 0.4), (4500.0, 0.77), (6000.0, 0.98)];

/// What the paper's motor took beyond its simulation, W.
const OFFSET_W: f64 = 2.8;

/// Speed at which the real motor's iron loss is fitted to that figure, rpm.
const IRON_LOSS_RPM: f64 = 4500.0;

/// Both drives at a speed, and the ideal ones of section III at the same torque.
struct Point {
    rpm: f64,
    published: Means,
    /// Mean angle error with a real and with an ideal board, degrees.
    error_deg: [f64; 2],
    six_step: Means,
    /// Both with the real motor, if the paper prints something.
    real: Option<[Means; 2]>,
    ideal_foc: Means,
    ideal_six_step: Means,
}

impl Point {
    fn measure(rpm: f64) -> Self {
        let (published, error_deg) = Drive::Published.at(rpm, Realism::Board);
        let (_, ideal_error_deg) = Drive::Published.at(rpm, Realism::Ideal);
        let (six_step, _) = Drive::SixStep.at(rpm, Realism::Board);
        let drives = [Drive::Published, Drive::SixStep];
        let torque_nm = load_nm(rpm);
        let foc = Foc {
            rpm,
            torque_nm,
            modulation: Modulation::Sine,
            dead_time_s: 0.0,
        };
        Self {
            rpm,
            published,
            error_deg: [error_deg, ideal_error_deg],
            six_step,
            real: printed(rpm).map(|_| drives.map(|drive| drive.at(rpm, Realism::Motor).0)),
            ideal_foc: foc.at_torque(torque_nm, 0.1).measure(0.1),
            ideal_six_step: SixStep::at_torque(rpm, torque_nm, 0.0, 0.1).measure(0.1),
        }
    }

    /// Returns the offset of the real motor's power, W.
    fn offset_w(&self) -> f64 {
        self.real_w() - self.published.motor_w()
    }

    /// Returns the power of the published drive with the real motor, W; NaN if not measured.
    fn real_w(&self) -> f64 {
        self.real.map_or(f64::NAN, |[foc, _]| foc.motor_w())
    }

    /// Returns the efficiency gain of the published drive with the real motor, points.
    fn real_better(&self) -> f64 {
        self.real
            .map_or(f64::NAN, |[foc, six_step]| better(&foc, &six_step))
    }
}

/// Returns the efficiency gain of the first over the second, points.
fn better(first: &Means, second: &Means) -> f64 {
    first.efficiency_pct() - second.efficiency_pct()
}

/// Returns what the paper prints at this speed.
fn printed(rpm: f64) -> Option<f64> {
    let at = PRINTED.iter().find(|(printed_rpm, _)| *printed_rpm == rpm);
    at.map(|(_, points)| *points)
}

/// Measures the figure and what the paper prints of it.
pub(super) fn figure_7() -> (Vec<Item>, Figure) {
    let points: Vec<Point> = SPEEDS_RPM.into_par_iter().map(Point::measure).collect();
    let of_printed: Vec<&Point> = points.iter().filter(|p| printed(p.rpm).is_some()).collect();
    let differences = of_printed.iter().flat_map(|point| {
        let name = format!("fig7_efficiency_diff_{:.0}", point.rpm);
        let note = "figure 7(c), an experiment: published drive at 15 kHz less six-step by zero \
                    crossings at 40 kHz";
        [
            item(
                &name,
                printed(point.rpm),
                better(&point.published, &point.six_step),
                "pt",
                format!("{note}; sinusoidal motor without iron loss"),
            ),
            item(
                format!("{name}_real_motor"),
                printed(point.rpm),
                point.real_better(),
                "pt",
                format!("{note}; motor with estimated harmonics and iron loss"),
            ),
        ]
    });
    let offsets = of_printed.iter().map(|point| {
        item(
            format!("fig7_power_offset_{:.0}", point.rpm),
            // At this speed the real motor's iron loss is the paper's offset, hence no result.
            Some(OFFSET_W).filter(|_| point.rpm != IRON_LOSS_RPM),
            point.offset_w(),
            "W",
            "figure 7(d): real motor less sinusoidal one; the former's iron loss at 4500 rpm is \
             taken from the paper's figure",
        )
    });
    let errors = of_printed.iter().flat_map(|point| {
        let [real, ideal] = point.error_deg;
        let name = format!("angle_error_{:.0}", point.rpm);
        let note = "mean of estimated less true angle, published drive; the paper prints none";
        [
            item(
                &name,
                None,
                ideal,
                "deg",
                format!("{note}; exact sensing, no dead time"),
            ),
            item(
                format!("{name}_board"),
                None,
                real,
                "deg",
                format!("{note}; 12 bits, 0.05 A of noise, 500 ns of dead time"),
            ),
        ]
    });
    let items = differences.chain(offsets).chain(errors);
    (items.collect(), draw(&points))
}

fn draw(points: &[Point]) -> Figure {
    let over = |value: &dyn Fn(&Point) -> f64| -> Vec<(f64, f64)> {
        points
            .iter()
            .map(|point| (point.rpm, value(point)))
            .collect()
    };
    let (published, six_step) = ("FOC, 15 kHz", "six-step, 40 kHz");
    let above_six_step: Vec<(f64, f64)> = points
        .iter()
        .filter_map(|point| {
            let gain = printed(point.rpm)?;
            Some((point.rpm, point.six_step.efficiency_pct() + gain))
        })
        .collect();
    let speed = "speed (rpm)";
    Figure {
        name: "bosso-7".to_owned(),
        title: "Drives without a position sensor with the propeller (first paper, figure 7)"
            .to_owned(),
        columns: 2,
        panel: PANEL,
        panels: vec![
            Panel::new(
                "(a) motor power",
                Axis::new(speed),
                Axis::new("power (W)"),
                vec![
                    Curve::line(published, over(&|p| p.published.motor_w())),
                    Curve::line(six_step, over(&|p| p.six_step.motor_w())),
                    Curve::dashed(
                        "FOC + 2.8 W, the paper's offset",
                        over(&|p| p.published.motor_w() + OFFSET_W),
                    ),
                    Curve::dots("FOC, real motor", over(&Point::real_w)),
                ],
            ),
            Panel::new(
                "(b) copper losses",
                Axis::new(speed),
                Axis::new("losses (W)"),
                vec![
                    Curve::line(published, over(&|p| p.published.copper_w())),
                    Curve::line(six_step, over(&|p| p.six_step.copper_w())),
                ],
            ),
            Panel::new(
                "(c) efficiency",
                Axis::new(speed),
                Axis::new("efficiency (%)"),
                vec![
                    Curve::line(published, over(&|p| p.published.efficiency_pct())),
                    Curve::line(six_step, over(&|p| p.six_step.efficiency_pct())),
                    Curve::dots("six-step + the paper's gain", above_six_step),
                ],
            ),
            Panel::new(
                "(d) efficiency against the exact angle's",
                Axis::new(speed),
                Axis::new("efficiency (%)"),
                vec![
                    Curve::line(published, over(&|p| p.published.efficiency_pct())),
                    Curve::dashed("FOC, exact angle", over(&|p| p.ideal_foc.efficiency_pct())),
                    Curve::dashed(
                        "six-step 15 kHz, exact angle",
                        over(&|p| p.ideal_six_step.efficiency_pct()),
                    ),
                ],
            ),
        ],
    }
}
