//! Sine and cosine from a table and one rotation; the angle of a vector.

use fixed::FixedI32;
use fixed::types::I1F31;
use fixed::types::extra::{U31, U32};

use super::{Number, Quantity, TopProduct};

/// The dimension of an angle.
#[derive(Clone, Copy, Debug)]
pub enum Turn {}

/// An angle in turns, electrical unless stated otherwise; it wraps.
pub type Angle = Quantity<Turn, U32>;

traced! {
    /// Cosine and sine of an angle.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct SinCos {
        /// Cosine, −1 to 1 − 2^-31.
        pub cos: I1F31,
        /// Sine, same range.
        pub sin: I1F31,
    }
}

impl SinCos {
    /// Returns [`sin_cos`] of an angle in turns, out of line: for code off the default drive's hot path.
    #[inline(never)]
    pub fn of(angle: Angle) -> Self {
        sin_cos(angle)
    }
}

const TABLE_BITS: u32 = 8;
const TABLE_SIZE: usize = 1 << TABLE_BITS;
const LENGTH: f64 = 1.0 - 7.6e-5;

/// A quarter of a turn.
const QUARTER: usize = TABLE_SIZE / 4;

/// Sines at the table's angles; a cosine is the sine a quarter turn on. The remaining rotation is at most ±π/256 and
/// lengthens by up to 7.6e-5, so the entries are shorter by as much to keep every sum within ±1.
static TABLE: [I1F31; TABLE_SIZE] = table();

/// 2π/8: converts the remainder from turns to radians, scaled by an eighth to stay below 1.
const EIGHTH_TURN: I1F31 = I1F31::from_bits(1_686_629_713);

/// Returns the cosine and sine of an angle in turns.
///
/// The direction is accurate to 0.0001°; the length is 1 − 8e-5 to 1.
#[inline(always)] // in each period
pub fn sin_cos(angle: Angle) -> SinCos {
    let bits = angle.to_bits() as u32;
    let half_section = 1 << (31 - TABLE_BITS);
    let near = (bits.wrapping_add(half_section) >> (32 - TABLE_BITS)) as usize;
    let (cos, sin) = (TABLE[(near + QUARTER) % TABLE_SIZE], TABLE[near]);
    // Offset from the nearest table angle, with 8 bits more than an angle. Times 2π/8 it is in radians with 36 fraction
    // bits, and its product with a cosine has 35, four more than needed.
    let remainder = FixedI32::<U31>::from_bits((bits << TABLE_BITS) as i32);
    let delta = remainder.top(EIGHTH_TURN);
    let cos_step = delta.top(cos).to_bits() >> 4;
    let sin_step = delta.top(sin).to_bits() >> 4;
    SinCos {
        cos: I1F31::from_bits(cos.to_bits() - sin_step),
        sin: I1F31::from_bits(sin.to_bits() + cos_step),
    }
}

/// Returns the angle of the vector (`x`, `y`) in turns, −0.5 to 0.5; 0 for the zero vector.
///
/// A polynomial over one octant, accurate to 0.02°. It divides, so the default drive calls it in a start only; the
/// modified regulator and the flux crossings' observer call it in each period.
#[inline(always)] // in each period
pub fn atan2_turns<T: Number>(y: T, x: T) -> Angle {
    Angle::from_bits(direction(y.to_bits(), x.to_bits()))
}

/// Shared by all types.
fn direction(y: i32, x: i32) -> i32 {
    let (ax, ay) = (x.unsigned_abs(), y.unsigned_abs());
    if ax == 0 && ay == 0 {
        return 0;
    }
    let steep = ay > ax;
    let (small, large) = if steep { (ax, ay) } else { (ay, ax) };
    // q = small/large with 30 fraction bits, 15 of them good (0.002°): more would take a 64-bit division, which the
    // chip lacks. The polynomial is arctan(q)/2π with 32.
    let zeros = large.leading_zeros();
    let q = i64::from((small << zeros) / ((large << zeros) >> 15)) << 15;
    let q2 = (q * q) >> 30;
    // Abramowitz and Stegun 4.4.49, each coefficient times 2^32/2π.
    let mut sum = 14_241_949_i64;
    for coefficient in [-58_193_354, 123_143_239, -225_778_694, 683_476_103] {
        sum = coefficient + ((sum * q2) >> 30);
    }
    let octant = (sum * q) >> 30;
    let quadrant = if steep { (1 << 30) - octant } else { octant };
    let half = if x.is_negative() {
        (1 << 31) - quadrant
    } else {
        quadrant
    };
    let turns = if y.is_negative() { -half } else { half };
    // Half a turn wraps to minus half a turn, the same angle.
    turns as i32
}

const fn table() -> [I1F31; TABLE_SIZE] {
    let mut table = [I1F31::ZERO; TABLE_SIZE];
    let mut i = 0;
    while i < table.len() {
        let radians = i as f64 * core::f64::consts::TAU / TABLE_SIZE as f64;
        table[i] = to_fixed(LENGTH * sine(radians));
        i += 1;
    }
    table
}

/// Rounds to nearest.
const fn to_fixed(x: f64) -> I1F31 {
    let scaled = x * 2_147_483_648.0;
    let half = if scaled < 0.0 { -0.5 } else { 0.5 };
    I1F31::from_bits((scaled + half) as i32)
}

/// Taylor series about the nearest multiple of π, evaluated by the compiler so that the table does not depend on any
/// machine's library.
const fn sine(radians: f64) -> f64 {
    use core::f64::consts::PI;
    let half_turns = (radians / PI + 0.5) as i64;
    let x = radians - half_turns as f64 * PI;
    let mut term = if half_turns % 2 == 0 { x } else { -x };
    let mut sum = 0.0;
    let mut n = 1;
    while n < 24 {
        sum += term;
        term *= -x * x / ((n + 1) as f64 * (n + 2) as f64);
        n += 2;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;
    use fixed::types::I4F28;

    #[test]
    fn sine_and_cosine_are_within_a_ten_thousandth_of_a_degree() {
        let mut worst_deg = 0.0_f64;
        let mut worst_length = 0.0_f64;
        for i in 0..100_000_u32 {
            let angle = Angle::from_bits(i.wrapping_mul(42_949).wrapping_mul(3) as i32);
            let turns = angle.to_num::<f64>();
            let SinCos { cos, sin } = sin_cos(angle);
            let (c, s) = (cos.to_num::<f64>(), sin.to_num::<f64>());
            let error = (s * (TAU * turns).cos() - c * (TAU * turns).sin()).asin();
            worst_deg = worst_deg.max(error.to_degrees().abs());
            worst_length = worst_length.max((c.hypot(s) - 1.0).abs());
        }
        assert!(worst_deg < 0.0001, "{worst_deg}");
        assert!(worst_length < 8e-5, "{worst_length}");
    }

    #[test]
    fn the_ends_of_a_turn_meet() {
        let below = sin_cos(Angle::from_bits(-1));
        let above = sin_cos(Angle::ZERO);
        assert!((below.cos - above.cos).abs() < I1F31::from_num(1e-6));
        assert!((below.sin - above.sin).abs() < I1F31::from_num(1e-6));
    }

    #[test]
    fn the_angle_of_a_vector_is_within_two_hundredths_of_a_degree() {
        for i in 0..10_000 {
            let turns = f64::from(i) / 10_000.0 - 0.5;
            let (y, x) = (TAU * turns).sin_cos();
            let got = atan2_turns(I4F28::from_num(y * 3.0), I4F28::from_num(x * 3.0));
            let error = (got.to_num::<f64>() - turns + 0.5).rem_euclid(1.0) - 0.5;
            assert!((error * 360.0).abs() < 0.02, "{turns}: {error}");
        }
        assert_eq!(atan2_turns(I4F28::ZERO, I4F28::ZERO), Angle::ZERO);
    }
}
