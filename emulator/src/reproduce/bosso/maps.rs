//! Figures 3 and 4: both drives over speed and mean torque.

use rayon::prelude::*;

use super::foc::{Foc, Modulation};
use super::means::Means;
use super::setting::load_nm;
use super::six_step::SixStep;
use crate::plot::chart::{Axis, Curve, Figure, Map, PANEL, Panel};

/// Time over which each grid setting is measured, s.
const MEASURE_S: f64 = 0.1;

/// Grid settings per speed.
const SIX_STEP_SETTINGS: u32 = 16;
const FOC_SETTINGS: u32 = 10;

/// Least and greatest commanded torque, Nm.
const TORQUE_NM: [f64; 2] = [0.01, 0.22];

/// An electrical turn at 4500 rpm, s.
const WAVEFORM_S: f64 = 1.0 / 900.0;

/// Range of both waveforms, Nm.
const WAVEFORM_NM: (f64, f64) = (-0.05, 0.25);

/// A drive's performance at a mean torque.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reading {
    motor_w: f64,
    copper_w: f64,
    ripple_pct: f64,
}

impl Reading {
    fn efficiency_pct(&self) -> f64 {
        100.0 * (1.0 - self.copper_w / self.motor_w)
    }
}

/// Readings on the grid of the pictures, rows of torques from the lowest.
struct Grid {
    rows: Vec<Vec<Option<Reading>>>,
}

fn speeds_rpm() -> Vec<f64> {
    (10..=26).map(|n| 250.0 * f64::from(n)).collect()
}

fn torques_nm() -> Vec<f64> {
    (3..=20).map(|n| 0.01 * f64::from(n)).collect()
}

fn six_step(rpm: f64) -> Vec<Means> {
    let settings = 0..SIX_STEP_SETTINGS;
    let means = settings.map(|n| {
        let share = f64::from(n) / f64::from(SIX_STEP_SETTINGS - 1);
        // At 6500 rpm commutation takes more voltage than the resistance does.
        let drive = SixStep::near(rpm, 2.5 * TORQUE_NM[1] * share);
        drive.measure(MEASURE_S)
    });
    means.collect()
}

fn foc(rpm: f64) -> Vec<Means> {
    let settings = 0..FOC_SETTINGS;
    let means = settings.map(|n| {
        let share = f64::from(n) / f64::from(FOC_SETTINGS - 1);
        let drive = Foc {
            rpm,
            torque_nm: TORQUE_NM[0] + (TORQUE_NM[1] - TORQUE_NM[0]) * share,
            modulation: Modulation::Sine,
            dead_time_s: 0.0,
        };
        drive.measure(MEASURE_S)
    });
    means.collect()
}

impl Grid {
    /// Measures a drive over its own settings at each speed, and interpolates it at the pictures'
    /// torques.
    fn measure(drive: impl Fn(f64) -> Vec<Means> + Sync) -> Self {
        let columns: Vec<Vec<Option<Reading>>> = speeds_rpm()
            .into_par_iter()
            .map(|rpm| {
                let measured = drive(rpm);
                let torques = torques_nm().into_iter();
                torques.map(|torque| read(&measured, torque)).collect()
            })
            .collect();
        let rows = 0..torques_nm().len();
        Self {
            rows: rows
                .map(|row| columns.iter().map(|column| column[row]).collect())
                .collect(),
        }
    }

    fn map(&self, label: &str, value: impl Fn(&Reading) -> f64) -> Map {
        map(label, |row, column| {
            self.rows[row][column].map(|reading| value(&reading))
        })
    }

    /// Maps a function of both drives' readings.
    fn against(&self, label: &str, other: &Self, value: impl Fn(&Reading, &Reading) -> f64) -> Map {
        map(label, |row, column| {
            let both = self.rows[row][column].zip(other.rows[row][column]);
            both.map(|(mine, theirs)| value(&mine, &theirs))
        })
    }
}

fn map(label: &str, value: impl Fn(usize, usize) -> Option<f64>) -> Map {
    let (x, y) = (speeds_rpm(), torques_nm());
    let rows = 0..y.len();
    let rows = rows.map(|row| {
        let columns = 0..x.len();
        columns
            .map(|column| value(row, column).unwrap_or(f64::NAN))
            .collect()
    });
    Map {
        label: label.to_owned(),
        rows: rows.collect(),
        x,
        y,
        range: None,
    }
}

/// Interpolates a drive's performance at a torque, by the parabola through the three measurements
/// around it: power is linear in torque and the loss quadratic.
fn read(measured: &[Means], torque_nm: f64) -> Option<Reading> {
    // Once the supply is exhausted the torque no longer rises.
    let rising = measured
        .windows(2)
        .take_while(|pair| pair[1].torque_nm() > pair[0].torque_nm() + 1e-3);
    let points = &measured[..=rising.count()];
    let above = points
        .iter()
        .position(|means| means.torque_nm() >= torque_nm)?;
    if above == 0 || points.len() < 3 {
        return None;
    }
    let first = (above - 1).min(points.len() - 3);
    let three = &points[first..first + 3];
    let weights = [0, 1, 2].map(|n: usize| {
        let at = |k: usize| three[k].torque_nm();
        let (k, l) = ((n + 1) % 3, (n + 2) % 3);
        (torque_nm - at(k)) * (torque_nm - at(l)) / ((at(n) - at(k)) * (at(n) - at(l)))
    });
    let sum = |of: fn(&Means) -> f64| {
        let terms = three.iter().zip(weights);
        terms.map(|(means, weight)| weight * of(means)).sum::<f64>()
    };
    // The ripple itself diverges towards zero torque; times the torque it does not.
    let ripple_nm = sum(|means| means.ripple_pct() * means.torque_nm());
    Some(Reading {
        motor_w: sum(Means::motor_w),
        copper_w: sum(Means::copper_w),
        ripple_pct: ripple_nm / torque_nm,
    })
}

/// Returns the propeller's curve within the maps.
fn load_curve() -> Curve {
    let speeds = (50..=130).map(|n| 50.0 * f64::from(n));
    let points = speeds.map(|rpm| (rpm, load_nm(rpm)));
    let within = points.filter(|(_, torque_nm)| (0.03..=0.2).contains(torque_nm));
    Curve::dashed("propeller", within)
}

fn over_speed(title: &str, map: Map) -> Panel {
    let (x, y) = (Axis::new("speed (rpm)"), Axis::new("mean torque (Nm)"));
    Panel {
        map: Some(map),
        ..Panel::new(title, x, y, vec![load_curve()])
    }
}

/// Measures and draws figures 3 and 4.
pub(super) fn figures() -> Vec<Figure> {
    let (bldc, foc) = rayon::join(|| Grid::measure(six_step), || Grid::measure(foc));
    vec![efficiency(&bldc, &foc), ripple(&bldc, &foc)]
}

fn efficiency(bldc: &Grid, foc: &Grid) -> Figure {
    let power = |grid: &Grid| grid.map("motor power (W)", |reading| reading.motor_w);
    let losses = |grid: &Grid| grid.map("copper losses (W)", |reading| reading.copper_w);
    let efficiency = |grid: &Grid| grid.map("efficiency (%)", Reading::efficiency_pct);
    let [bldc_power, foc_power] = power(bldc).alike(power(foc));
    let [bldc_losses, foc_losses] = losses(bldc).alike(losses(foc));
    let [bldc_efficiency, foc_efficiency] = efficiency(bldc).alike(efficiency(foc));
    let better = foc.against("difference (points)", bldc, |foc, bldc| {
        foc.efficiency_pct() - bldc.efficiency_pct()
    });
    let more = bldc.against("more losses (%)", foc, |bldc, foc| {
        100.0 * (bldc.copper_w / foc.copper_w - 1.0)
    });
    Figure {
        name: "bosso-3".to_owned(),
        title: "Power and efficiency of six-step and field-oriented control, exact angle, 15 kHz \
                (first paper, figure 3)"
            .to_owned(),
        // The paper's letters, but what is compared side by side: its four columns would be too wide to read.
        columns: 2,
        panel: PANEL,
        panels: vec![
            over_speed("(a) six-step: power", bldc_power),
            over_speed("(e) FOC: power", foc_power),
            over_speed("(b) six-step: losses", bldc_losses),
            over_speed("(f) FOC: losses", foc_losses),
            over_speed("(c) six-step: efficiency", bldc_efficiency),
            over_speed("(g) FOC: efficiency", foc_efficiency),
            over_speed("(d) efficiency, FOC less six-step", better),
            over_speed("(h) losses, six-step over FOC", more),
        ],
    }
}

fn ripple(bldc: &Grid, foc: &Grid) -> Figure {
    let (rpm, torque_nm) = (4500.0, load_nm(4500.0));
    let map = |grid: &Grid| grid.map("torque ripple (%)", |reading| reading.ripple_pct);
    let [bldc_ripple, foc_ripple] = map(bldc).alike(map(foc));
    let waveform = |title: &str, points: Vec<(f64, f64)>| {
        let points: Vec<_> = points
            .into_iter()
            .map(|(t_s, nm)| (1e3 * t_s, nm))
            .collect();
        let end_ms = 1e3 * WAVEFORM_S;
        let mean = Curve::dashed("mean", vec![(0.0, torque_nm), (end_ms, torque_nm)]);
        let curves = vec![Curve::line("torque", points), mean];
        let mut panel = Panel::new(
            title,
            Axis::new("time (ms)"),
            Axis::new("torque (Nm)"),
            curves,
        );
        panel.y.range = Some(WAVEFORM_NM);
        panel
    };
    let six_step = SixStep::at_torque(rpm, torque_nm, 0.0, MEASURE_S);
    let drive = Foc {
        rpm,
        torque_nm,
        modulation: Modulation::Sine,
        dead_time_s: 0.0,
    };
    let drive = drive.at_torque(torque_nm, MEASURE_S);
    Figure {
        name: "bosso-4".to_owned(),
        title: "Torque ripple of six-step and field-oriented control, exact angle, 15 kHz \
                (first paper, figure 4)"
            .to_owned(),
        columns: 2,
        panel: PANEL,
        panels: vec![
            over_speed("(a) six-step: ripple", bldc_ripple),
            waveform(
                "(b) six-step: torque at 4500 rpm, 0.0972 Nm",
                six_step.waveform(WAVEFORM_S),
            ),
            over_speed("(c) FOC: ripple", foc_ripple),
            waveform(
                "(d) FOC: torque at 4500 rpm, 0.0972 Nm",
                drive.waveform(WAVEFORM_S),
            ),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::Flow;

    /// Returns a drive that takes 500 W/Nm, loses 300 W/Nm² and has a ripple of 0.03 Nm.
    fn means(torque_nm: f64) -> Means {
        let flow = Flow {
            torque_nm,
            torque_square: torque_nm * torque_nm + 0.03 * 0.03,
            motor_w: 500.0 * torque_nm,
            copper_w: 300.0 * torque_nm * torque_nm,
            ..Flow::default()
        };
        let mut means = Means::default();
        means.add(&flow, 1.0);
        means
    }

    #[test]
    fn a_reading_is_between_the_measurements() {
        let measured = [0.01, 0.05, 0.12, 0.2, 0.2].map(means);
        let reading = read(&measured, 0.09).expect("within");
        assert!((reading.motor_w - 45.0).abs() < 1e-9);
        assert!((reading.copper_w - 300.0 * 0.0081).abs() < 1e-9);
        assert!((reading.ripple_pct - 100.0 * 0.03 / 0.09).abs() < 1e-9);
        for outside in [0.005, 0.21] {
            assert_eq!(read(&measured, outside), None);
        }
    }
}
