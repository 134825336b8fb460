//! Functions by series, for the small arguments of a fraction of a control period: several times faster than the
//! library's, and the same bits on every machine.

use std::ops::{Add, Mul};

/// The argument of a series: a number, or several side by side.
pub(super) trait Number:
    Copy + Add<Output = Self> + Mul<Output = Self> + Add<f64, Output = Self> + Mul<f64, Output = Self>
{
}

impl Number for f64 {}
impl Number for wide::f64x4 {}

/// Returns cosine and sine to 1e-15 by their series up to x¹¹, for up to [`ROTATION_MAX`] radians.
#[inline(always)] // in each period
pub(super) fn small_rotation<T: Number>(radians: T) -> [T; 2] {
    let cos = polynomial(
        radians * radians,
        [
            1.0,
            -1.0 / 2.0,
            1.0 / 24.0,
            -1.0 / 720.0,
            1.0 / 40_320.0,
            -1.0 / 3_628_800.0,
        ],
    );
    [cos, radians * small_sinc(radians)]
}

/// Returns sin(x)/x to 1e-15, for up to [`ROTATION_MAX`] radians.
#[inline(always)] // in each period
pub(super) fn small_sinc<T: Number>(radians: T) -> T {
    polynomial(
        radians * radians,
        [
            1.0,
            -1.0 / 6.0,
            1.0 / 120.0,
            -1.0 / 5_040.0,
            1.0 / 362_880.0,
            -1.0 / 39_916_800.0,
        ],
    )
}

/// Evaluates a polynomial of six coefficients, the constant one first, in pairs (Estrin): half the latency of Horner's
/// rule.
#[inline(always)] // in each period
fn polynomial<T: Number>(x: T, c: [f64; 6]) -> T {
    let square = x * x;
    (x * c[1] + c[0]) + square * ((x * c[3] + c[2]) + square * (x * c[5] + c[4]))
}

/// See [`small_rotation`].
pub(super) const ROTATION_MAX: f64 = 0.3;

/// Returns cosine and sine.
pub(super) fn rotation(radians: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(radians);
    [cos, sin]
}

/// Returns e^(−x) to 2e-15 by its series up to x⁹, for 0 to [`DECAY_MAX`].
#[inline(always)] // in each period
pub(super) fn small_decay<T: Number>(x: T) -> T {
    let square = x * x;
    let low = polynomial(
        x,
        [1.0, -1.0, 1.0 / 2.0, -1.0 / 6.0, 1.0 / 24.0, -1.0 / 120.0],
    );
    let high =
        (x * (-1.0 / 5_040.0) + 1.0 / 720.0) + square * (x * (-1.0 / 362_880.0) + 1.0 / 40_320.0);
    low + square * square * square * high
}

/// See [`small_decay`].
pub(super) const DECAY_MAX: f64 = 0.15;

/// Returns the fraction of a number of turns, 0..1.
pub(super) fn fraction(turns: f64) -> f64 {
    let rest = turns - (turns as i64) as f64;
    if rest < 0.0 { rest + 1.0 } else { rest }
}

/// Returns zero for what has decayed to nothing: subnormal arithmetic is many times slower.
pub(super) fn settle(x: f64) -> f64 {
    if x.abs() < 1e-15 { 0.0 } else { x }
}

/// Finds the zero of `f` between 0 and `end`, to `tolerance` of f; the signs at the ends differ.
///
/// Uses the secant with the stale end's weight halved (the Illinois rule), which cannot leave the bracket; 60 steps
/// bound it, six are usual.
pub(super) fn root(
    f: impl Fn(f64) -> f64,
    at_0: f64,
    at_end: f64,
    end: f64,
    tolerance: f64,
) -> f64 {
    let (mut a, mut fa) = (0.0, at_0);
    let (mut b, mut fb) = (end, at_end);
    for _ in 0..60 {
        let x = b - fb * (b - a) / (fb - fa);
        let fx = f(x);
        if fx.abs() <= tolerance {
            return x;
        }
        if (fx < 0.0) == (fb < 0.0) {
            fa *= 0.5;
        } else {
            (a, fa) = (b, fb);
        }
        (b, fb) = (x, fx);
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_are_the_functions() {
        for i in -100..=100 {
            let x = f64::from(i) * 0.01 * ROTATION_MAX;
            let (c, s) = (small_rotation(x)[0], small_rotation(x)[1]);
            let [cos, sin] = rotation(x);
            assert!((c - cos).abs() < 2e-15 && (s - sin).abs() < 2e-15, "{x}");
            let x = f64::from(i).abs() * 0.01 * DECAY_MAX;
            assert!((small_decay(x) - libm::exp(-x)).abs() < 3e-15, "{x}");
        }
    }

    #[test]
    fn fractions_of_turns_are_not_negative() {
        assert_eq!(fraction(-0.25), 0.75);
        assert_eq!(fraction(3.5), 0.5);
    }

    #[test]
    fn a_root_is_found_where_the_secant_alone_crawls() {
        let f = |x: f64| x.powi(9) - 1e-3;
        let x = root(f, f(0.0), f(2.0), 2.0, 1e-12);
        assert!((x.powi(9) - 1e-3).abs() <= 1e-12, "{x}");
    }
}
