//! Table III: the gains that the drive computes, and the resulting roots of the polynomials (20) and (21) and
//! eigenvalues of the matrices (22) and (23).

use std::f64::consts::TAU;

use fixed::types::extra::Unsigned;
use siskin_control::build::build;
use siskin_control::control::PERIODS;
use siskin_control::control::{observer, regulator, speed};
use siskin_params::{BOSSO_BENCH, BOSSO_TABLE_III, Delay, Params};
use siskin_units::Scale;
use siskin_units::math::{Gain, Number};

use super::setting::MOTOR;
use crate::plant::Sensing;
use crate::reproduce::item::{Item, item};

/// Speed at which (22) and (23) are linearised, rad/s.
const OMEGA_M: f64 = 4500.0 * TAU / 60.0;

/// J and d_1 of section V, kg·m² and Nm·s/rad.
const J: f64 = 1.43e-4;
const D_1: f64 = 4.08e-4;

/// The gains of Table III.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Gains {
    k_p: f64,
    k_i: f64,
    k_pe: f64,
    k_ie: f64,
    k_eta: f64,
    gamma: f64,
    k_p_omega: f64,
    k_i_omega: f64,
}

/// As printed.
const PRINTED: Gains = Gains {
    k_p: 1178.0,
    k_i: 340.0,
    k_pe: 964.0,
    k_ie: 154.6,
    k_eta: 115.8,
    gamma: 6707.0,
    k_p_omega: 7.1e-3,
    k_i_omega: 41.7e-3,
};

/// The printed eigenvalues: real and imaginary part of a pair, or two real roots.
const PRINTED_ROOTS: [[f64; 2]; 4] = [
    [-2360.0, 2360.0],
    [-2357.0, -2142.0],
    [-429.0, 429.0],
    [-46.6, -6.3],
];

/// Returns a gain's value between the two units, from its effect.
fn value<A: Number, B: Number>(gain: Gain<A, B>) -> f64 {
    let x = A::from_bits(1 << 22);
    let y = gain.apply(x);
    let bits_per_bit = f64::from(y.to_bits()) / f64::from(x.to_bits());
    libm::scalbn(bits_per_bit, A::Frac::I32 - B::Frac::I32)
}

impl Gains {
    /// Returns what the drive computes for its control period, in the paper's units.
    fn computed() -> Self {
        let mut params = Params::of(&BOSSO_BENCH);
        for (id, value) in BOSSO_TABLE_III.settings {
            params.set(*id, *value).expect("within the table");
        }
        let config = build(&params, &Sensing::default().board(Delay::One));
        let config = config.expect("the preset is the paper's drive");
        let (
            observer::Config::BackEmf(observer, _),
            regulator::Config::ObserverBased(regulator, _),
            speed::Law::Nested(speed),
        ) = (&config.observer, &config.regulator, &config.speed.law)
        else {
            unreachable!("the preset is the paper's drive");
        };
        let Scale {
            period_s,
            current_a,
            voltage_v,
            ..
        } = config.scale;
        let (period_s, ohm) = (f64::from(period_s), f64::from(voltage_v / current_a));
        let (r, l) = (MOTOR.resistance_ohm, MOTOR.inductance_h);
        // The time for which a constant derivative acts in a period of the matrix exponential.
        let acts_s = (1.0 - libm::exp(-r / l * period_s)) * l / r;
        let speed_unit = TAU / period_s;
        let torque_per_speed =
            speed_unit / (f64::from(MOTOR.pole_pairs) * f64::from(config.scale.torque_nm()));
        Self {
            k_p: value(observer.k_p) / acts_s,
            k_i: value(observer.k_i) * ohm / period_s,
            k_pe: value(regulator.k_pe) * ohm / l,
            k_ie: value(regulator.k_ie) * ohm / period_s,
            k_eta: value(observer.k_eta) * speed_unit / f64::from(voltage_v),
            gamma: value(observer.gamma) * f64::from(config.scale.inverse_flux_per_wb())
                / (period_s * f64::from(voltage_v)),
            k_p_omega: value(speed.k_p) / torque_per_speed,
            k_i_omega: value(speed.k_i) / (f64::from(PERIODS) * period_s * torque_per_speed),
        }
    }

    /// Returns them in the order of Table III, with names and units.
    fn named(&self) -> [(&'static str, f64, &'static str); 8] {
        [
            ("k_p", self.k_p, "1/s"),
            ("k_i", self.k_i, "Ω/s"),
            ("k_pe", self.k_pe, "1/s"),
            ("k_ie", self.k_ie, "Ω/s"),
            ("k_eta", self.k_eta, "1/Wb"),
            ("gamma", self.gamma, "1/Wb²"),
            ("k_p_omega", 1e3 * self.k_p_omega, "mNms"),
            ("k_i_omega", 1e3 * self.k_i_omega, "mNm"),
        ]
    }

    /// Returns the four pairs of roots: of (20), (21), (22), (23).
    fn roots(&self) -> [Roots; 4] {
        let (r, l) = (MOTOR.resistance_ohm, MOTOR.inductance_h);
        let chi = f64::from(MOTOR.pole_pairs) * OMEGA_M * MOTOR.flux_wb;
        [
            Roots::of(r / l + self.k_p, self.k_i / l),
            Roots::of(r / l + self.k_pe, self.k_ie / l),
            Roots::of(chi * self.k_eta, chi * chi * self.gamma),
            Roots::of((self.k_p_omega + D_1) / J, self.k_i_omega / J),
        ]
    }
}

/// The roots of λ² + b·λ + c.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Roots {
    /// Real part and magnitude of the imaginary part.
    Pair(f64, f64),
    /// The faster and the slower one.
    Real(f64, f64),
}

impl Roots {
    fn of(b: f64, c: f64) -> Self {
        let discriminant = 0.25 * b * b - c;
        let root = libm::sqrt(discriminant.abs());
        if discriminant < 0.0 {
            Self::Pair(-0.5 * b, root)
        } else {
            Self::Real(-0.5 * b - root, -0.5 * b + root)
        }
    }

    fn values(self) -> [f64; 2] {
        match self {
            Self::Pair(a, b) | Self::Real(a, b) => [a, b],
        }
    }

    fn names(self) -> [&'static str; 2] {
        match self {
            Self::Pair(..) => ["re", "im"],
            Self::Real(..) => ["1", "2"],
        }
    }
}

impl std::fmt::Display for Roots {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Pair(re, im) => write!(f, "{re:.1} ± {im:.1}i"),
            Self::Real(first, second) => write!(f, "{first:.1} and {second:.1}"),
        }
    }
}

/// Table III.
pub(super) fn items() -> Vec<Item> {
    let computed = Gains::computed();
    let named = computed.named().into_iter().zip(PRINTED.named());
    let gains = named.map(|((name, got, unit), (_, printed, _))| {
        item(
            format!("table3_{name}"),
            Some(printed),
            got,
            unit,
            "the fixed-point coefficient of the drive in the paper's unit",
        )
    });
    let equations = [
        ("observer", "(20)"),
        ("regulator", "(21), nearly a double root: compare the gains"),
        ("attitude", "(22) at 4500 rpm"),
        ("speed", "(23) at 4500 rpm"),
    ];
    let roots = computed.roots().into_iter().zip(PRINTED.roots());
    let roots = roots.zip(PRINTED_ROOTS).zip(equations);
    let roots = roots.flat_map(|(((roots, by_printed), printed), (name, equation))| {
        let note = format!("root of {equation}; the printed gains give {by_printed}");
        let values = roots.values().into_iter().zip(printed);
        let items = values.zip(roots.names()).map(|((got, printed), part)| {
            let name = format!("table3_{name}_{part}");
            item(name, Some(printed), got, "1/s", &note)
        });
        items.collect::<Vec<_>>()
    });
    gains.chain(roots).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_drive_computes_the_printed_gains() {
        let computed = Gains::computed();
        for ((name, got, _), (_, printed, _)) in computed.named().into_iter().zip(PRINTED.named()) {
            assert!(
                (got / printed - 1.0).abs() < 0.02,
                "{name}: {got} for {printed}"
            );
        }
    }

    #[test]
    fn the_printed_gains_have_the_printed_roots() {
        let [observer, regulator, attitude, speed] = PRINTED_ROOTS;
        let pair = |[re, im]: [f64; 2]| Roots::Pair(re, im);
        let real = |[first, second]: [f64; 2]| Roots::Real(first, second);
        let printed = [pair(observer), real(regulator), pair(attitude), real(speed)];
        // Sums and products: rounding moves the roots of (21), nearly a double one, much further.
        let coefficients = |roots| match roots {
            Roots::Pair(re, im) => [2.0 * re, re * re + im * im],
            Roots::Real(first, second) => [first + second, first * second],
        };
        for (roots, printed) in PRINTED.roots().into_iter().zip(printed) {
            for (got, printed) in coefficients(roots).into_iter().zip(coefficients(printed)) {
                assert!((got / printed - 1.0).abs() < 0.02, "{got} for {printed}");
            }
        }
    }
}
