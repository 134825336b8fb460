//! Clarke's and Park's transforms, preserving the amplitude (11), (12).

use fixed::FixedI32;
use fixed::types::extra::U32;
use fixed::types::{I3F29, I4F28, I5F27};

use crate::math::{Held, SinCos, TopProduct};
use crate::units::{AdcCounts, Current, Voltage};

/// A vector in the stator's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AlphaBeta<T> {
    /// Along the axis of phase a.
    pub alpha: T,
    /// A quarter of a turn ahead of it.
    pub beta: T,
}

/// A vector in the frame of the (estimated) rotor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dq<T> {
    /// Along the rotor's flux.
    pub d: T,
    /// A quarter of a turn ahead of it.
    pub q: T,
}

/// √3/4 with 32 fraction bits.
const ROOT_3_QUARTER: FixedI32<U32> = FixedI32::from_bits(1_859_775_393);

/// Clarke's transform of three readings (12): one unit of current is 4096/3 counts, so that two
/// integer products are enough.
///
/// Readings are within ±2048 counts, which makes each component at most 2 of ±4.
#[inline(always)]
pub fn clarke([a, b, c]: [AdcCounts; 3]) -> AlphaBeta<I3F29> {
    let (a, b, c) = (a.to_bits(), b.to_bits(), c.to_bits());
    // (2a − b − c)/3 counts are (2a − b − c)/4096 units: 2^28 of them a unit, and one bit more.
    let alpha = (2 * a - b - c) << 1;
    // (b − c)/√3 counts are (b − c)·√3/4096 units; √3/4 is what fits a factor below a half.
    let beta = FixedI32::<U32>::from_bits((b - c) << 2)
        .top(ROOT_3_QUARTER)
        .to_bits()
        << 1;
    AlphaBeta {
        alpha: I3F29::from_bits(alpha),
        beta: I3F29::from_bits(beta),
    }
}

/// The currents of Clarke's transform as the control's currents.
#[inline(always)]
pub fn currents(v: AlphaBeta<I3F29>) -> AlphaBeta<Current> {
    AlphaBeta {
        alpha: Current::from_bits(v.alpha.to_bits() >> 1),
        beta: Current::from_bits(v.beta.to_bits() >> 1),
    }
}

/// The voltages of the inverse of Park's transform as the control's voltages, held at the ends of
/// their type.
#[inline(always)]
pub fn voltages(v: AlphaBeta<I5F27>) -> AlphaBeta<Voltage> {
    let double = |x: I5F27| Voltage::from_bits(x.plus(x).to_bits());
    AlphaBeta {
        alpha: double(v.alpha),
        beta: double(v.beta),
    }
}

/// Park's transform (12): the stator's vector as the rotor sees it.
#[inline(always)]
pub fn park(v: AlphaBeta<I3F29>, SinCos { cos, sin }: SinCos) -> Dq<I4F28> {
    Dq {
        d: v.alpha.top(cos) + v.beta.top(sin),
        q: v.beta.top(cos) - v.alpha.top(sin),
    }
}

/// Park's transform of any vector of the stator's frame; components are held within ±4.
#[inline(always)]
pub fn to_rotor(v: AlphaBeta<I4F28>, frame: SinCos) -> Dq<I4F28> {
    let double = |x: I4F28| I3F29::from_bits(x.plus(x).to_bits());
    park(
        AlphaBeta {
            alpha: double(v.alpha),
            beta: double(v.beta),
        },
        frame,
    )
}

/// The inverse of Park's transform (11).
#[inline(always)]
pub fn inverse_park(v: Dq<Voltage>, SinCos { cos, sin }: SinCos) -> AlphaBeta<I5F27> {
    AlphaBeta {
        alpha: v.d.top(cos) - v.q.top(sin),
        beta: v.d.top(sin) + v.q.top(cos),
    }
}

/// The three phases' values of a vector (11).
#[inline(always)]
pub fn phases<F>(v: AlphaBeta<FixedI32<F>>) -> [FixedI32<F>; 3] {
    let alpha = v.alpha.to_bits();
    // √3/2 = 2·√3/4, and the product keeps the top half.
    let product = i64::from(v.beta.to_bits()) * i64::from(ROOT_3_QUARTER.to_bits());
    let beta = ((product >> 32) as i32) << 1;
    let half = alpha >> 1;
    [alpha, beta - half, -beta - half].map(FixedI32::from_bits)
}

/// Turns a rotor-frame vector against the frame: the vector as a frame sees it that leads by the
/// angle. Components are held within ±4.
pub fn rotate_frame(v: Dq<I4F28>, ahead: SinCos) -> Dq<I4F28> {
    to_rotor(
        AlphaBeta {
            alpha: v.d,
            beta: v.q,
        },
        ahead,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sin_cos;
    use crate::units::Angle;
    use core::f64::consts::TAU;

    /// A balanced vector of the given counts and angle as three readings.
    fn readings(counts: f64, turns: f64) -> [AdcCounts; 3] {
        [0.0, -1.0 / 3.0, 1.0 / 3.0]
            .map(|shift| AdcCounts::from_num(counts * (TAU * (turns + shift)).cos()))
    }

    #[test]
    fn a_vector_along_the_rotor_is_all_d() {
        for degrees in 0..360 {
            let turns = f64::from(degrees) / 360.0;
            let sc = sin_cos(Angle::from_bits((turns * 4_294_967_296.0) as i64 as i32));
            let v = park(clarke(readings(1365.0, turns)), sc);
            // 1365 counts of 4096/3 a unit; the table is 2e-5 short.
            assert!((v.d.to_num::<f64>() - 0.99976).abs() < 3e-5, "{v:?}");
            assert!(v.q.to_num::<f64>().abs() < 3e-6, "{v:?}");
        }
    }

    #[test]
    fn a_common_current_has_no_vector() {
        let v = clarke([AdcCounts::from_num(300); 3]);
        assert_eq!(v, AlphaBeta::default());
    }

    #[test]
    fn the_inverse_undoes_park() {
        let v = Dq {
            d: Voltage::from_num(0.25),
            q: Voltage::from_num(-1.5),
        };
        let sc = sin_cos(Angle::from_num(0.123));
        let stator = inverse_park(v, sc);
        let back = park(
            AlphaBeta {
                alpha: I3F29::from_num(stator.alpha),
                beta: I3F29::from_num(stator.beta),
            },
            sc,
        );
        assert!((back.d - v.d).abs() < Voltage::from_num(1e-4));
        assert!((back.q - v.q).abs() < Voltage::from_num(1e-4));
    }

    #[test]
    fn full_scale_does_not_overflow() {
        let most = AdcCounts::from_num(2047.9);
        let v = clarke([most, -most, -most]);
        assert!((v.alpha.to_num::<f64>() - 2.0).abs() < 1e-3);
        let v = clarke([AdcCounts::ZERO, most, -most]);
        assert!((v.beta.to_num::<f64>() - 3.0_f64.sqrt()).abs() < 1e-3);
    }
}
