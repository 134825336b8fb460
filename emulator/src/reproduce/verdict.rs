//! Judges whether a measurement agrees with the paper: within which bound, and why.
//!
//! A bound follows from how the paper derives its figure, not from the result here.

use serde::Serialize;

/// The outcome of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// It is within its bound.
    Agrees,
    /// It is outside.
    Differs,
    /// The paper has nothing to compare with, or nothing was measured.
    Open,
}

/// A comparison with the paper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Its outcome.
    pub verdict: Verdict,
    /// Range of agreement, both ends included, in the item's unit.
    pub bound: Option<[f64; 2]>,
    /// Why this range, and what is known of a difference.
    pub reason: &'static str,
}

/// How close to the paper's figure is close enough.
#[derive(Clone, Copy, Debug)]
enum Bound {
    /// This share of it to either side.
    Share(f64),
    /// This much to either side, in the item's unit.
    Within(f64),
    /// From zero up to it: it is itself a limit.
    AtMost,
}

use Bound::{AtMost, Share, Within};

/// What the items' names begin with; the first match counts.
const RULES: &[(&str, Bound, &str)] = &[
    (
        "copper_loss_ratio",
        Share(1e-4),
        "a formula, to the digits that the paper prints",
    ),
    (
        "efficiency_diff_",
        Share(0.25),
        "the paper's own simulation, whose supply and six-step switching it does not print: a quarter",
    ),
    (
        "ripple_",
        Share(0.1),
        "the ripple goes with the supply's voltage, which the paper does not print: a tenth",
    ),
    (
        "table2_",
        Within(0.0),
        "a count; the paper counts its equations, here the code is counted, with its limits, its rounding \
         and the angle ahead of which the voltage is applied",
    ),
    (
        "table3_",
        Share(0.01),
        "the paper prints two to four digits, here they are rounded to fixed point: a hundredth",
    ),
    (
        "fig7_efficiency_diff_",
        Share(0.5),
        "an experiment with one motor, whose losses the paper does not print: half of it, and so the sign. \
         Losses in the iron and harmonics cost six-step more: without them (a sinusoidal motor) 15 kHz gain \
         little on its 40 kHz, or lose, and with estimates of them (real_motor) a part of the paper's gain is \
         there",
    ),
    (
        "fig7_power_offset_",
        Share(0.5),
        "the paper has one offset for all speeds, a loss in the iron grows with the speed: half of it",
    ),
    (
        "fig19_",
        Share(0.02),
        "a formula of continuous time, met by a search in steps: a fiftieth",
    ),
    (
        "fig20_gain_",
        Within(0.1),
        "a formula of continuous time, here in samples: 0.1 dB",
    ),
    (
        "fig20_phase_",
        Within(0.5),
        "a formula of continuous time, here in samples: half a degree",
    ),
    (
        "fig21_",
        Within(0.5),
        "a formula of continuous time, here in samples: half a degree",
    ),
    (
        "fig27_",
        AtMost,
        "a bound of the worst case: not to be passed",
    ),
    (
        "fig28_",
        AtMost,
        "a bound of the worst case: not to be passed",
    ),
    (
        "fig30_",
        AtMost,
        "a bound of the worst case: not to be passed",
    ),
    (
        "table1_extrapolation",
        AtMost,
        "a bound of the worst case; the drive measures the speed at every edge and lags less",
    ),
    (
        "table1_position_filter",
        AtMost,
        "a bound of the worst case; the drive measures the speed at every edge and lags less",
    ),
    (
        "table1_",
        Share(0.05),
        "a formula of continuous time, here in samples: a twentieth",
    ),
    (
        "fig42_",
        Share(0.05),
        "a formula of continuous time, here in samples: a twentieth",
    ),
    (
        "fig43_flux",
        Share(0.05),
        "the motor's flux, by an integrator that leads and droops: a twentieth",
    ),
    (
        "fig43_current_",
        Within(5.0),
        "the current is led by the estimated rotor, the flux leads it by figure 42's: five degrees",
    ),
    (
        "fig50_peak_i_q",
        Share(0.1),
        "the torque that the climb needs, on which the speed loop overshoots: a tenth",
    ),
    (
        "fig50_i_d",
        Within(0.1),
        "regulated to zero: a hundredth of the climb's current",
    ),
    (
        "fig50_speed",
        Share(0.01),
        "regulated to the command, which still rises: a hundredth",
    ),
    (
        "fig52_",
        Share(0.05),
        "the motor's flux, by the formula of the integrator: a twentieth",
    ),
    (
        "fig54_k_",
        Share(0.1),
        "read from the paper's formula of the worst case: a tenth. The drive measures the speed at every \
         edge, which is 7 in place of 18N - 1 = 17 there: it comes to that error at a greater K",
    ),
    (
        "fig54_error_",
        AtMost,
        "a bound of the worst case; the drive measures the speed at every edge and errs less",
    ),
];

impl Comparison {
    /// Compares an item by its name.
    pub(super) fn of(name: &str, paper: Option<f64>, measured: Option<f64>) -> Self {
        let open = Self {
            verdict: Verdict::Open,
            bound: None,
            reason: "the paper has no figure to compare it with",
        };
        let rule = RULES.iter().find(|(begin, ..)| name.starts_with(begin));
        let (Some(paper), Some((_, bound, reason))) = (paper, rule) else {
            return open;
        };
        let [low, high] = match *bound {
            Share(share) => {
                let away = share * paper.abs();
                [paper - away, paper + away]
            }
            Within(away) => [paper - away, paper + away],
            AtMost => [0.0, paper],
        };
        let verdict = match measured {
            Some(measured) if (low..=high).contains(&measured) => Verdict::Agrees,
            Some(_) => Verdict::Differs,
            None => Verdict::Open,
        };
        Self {
            verdict,
            bound: Some([low, high]),
            reason,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sign_counts() {
        let of = |measured| {
            let compared = Comparison::of("fig7_efficiency_diff_3000", Some(0.4), Some(measured));
            assert_eq!(compared.bound, Some([0.2, 0.6000000000000001]));
            compared.verdict
        };
        assert_eq!(of(-1.12), Verdict::Differs);
        assert_eq!(of(0.3), Verdict::Agrees);
    }

    #[test]
    fn bounds_are_on_the_right_side() {
        for (name, paper, measured, verdict) in [
            ("table3_observer_re", -2360.0, -2356.0, Verdict::Agrees),
            ("table3_observer_re", -2360.0, -2300.0, Verdict::Differs),
            ("fig28_error_1000", 10.0, 5.0, Verdict::Agrees),
            ("fig28_error_1000", 10.0, 10.1, Verdict::Differs),
            ("fig28_error_1000", 10.0, -0.1, Verdict::Differs),
            ("table2_speed_filter_sums", 1.0, 2.0, Verdict::Differs),
        ] {
            let compared = Comparison::of(name, Some(paper), Some(measured));
            assert_eq!(compared.verdict, verdict, "{name} {measured}");
        }
        let none = Comparison::of("angle_error_3000", None, Some(0.3));
        assert_eq!((none.verdict, none.bound), (Verdict::Open, None));
        let none = Comparison::of("table1_low_pass", Some(5.0), None);
        assert_eq!(none.verdict, Verdict::Open);
    }
}
