//! Clarke's and Park's transforms, amplitude-invariant (11), (12).

use fixed::types::{I0F32, I1F31};
use siskin_units::math::{Held, Number, SinCos, TopProduct, TopSum};
use siskin_units::trace::Trace;
use siskin_units::{AdcCounts, Angle, Current, Speed, TurnedVoltage, Voltage, traced};

traced! {
    /// A vector in the stator's frame.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct AlphaBeta<T> {
        /// Along phase a.
        pub alpha: T,
        /// A quarter turn ahead of phase a.
        pub beta: T,
    }
}

traced! {
    /// A vector in the (estimated) rotor's frame.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Dq<T> {
        /// Along the rotor's flux.
        pub d: T,
        /// A quarter turn ahead of it.
        pub q: T,
    }
}

/// The order of the three phases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseOrder {
    /// ±√3/4, within the range of a factor below a half.
    root_3_quarter: I0F32,
    /// ±1.
    sign: i32,
}

impl Trace for PhaseOrder {
    /// One word: 1 if phases b and c are swapped.
    fn trace(&self, out: &mut impl FnMut(u32)) {
        (*self == Self::SWAPPED).trace(out);
    }
}

impl PhaseOrder {
    /// a, b, c.
    pub const NORMAL: Self = Self {
        root_3_quarter: I0F32::from_bits(1_859_775_393),
        sign: 1,
    };

    /// a, c, b: for a motor that turns the other way.
    pub const SWAPPED: Self = Self {
        root_3_quarter: I0F32::from_bits(-1_859_775_393),
        sign: -1,
    };

    /// Returns the order for a control that sees phases b and c swapped, or not.
    pub const fn of(swapped: bool) -> Self {
        if swapped { Self::SWAPPED } else { Self::NORMAL }
    }

    /// Converts an angle in this phase order's frame to one in the order a, b, c.
    #[inline(always)] // in each period
    pub fn angle(self, theta: Angle) -> Angle {
        theta.wrapping_mul_int(self.sign)
    }

    /// Converts a speed likewise.
    pub fn speed(self, omega: Speed) -> Speed {
        omega * self.sign
    }
}

/// Clarke's transform of three readings (12). One unit of current is 4096/3 counts, so two integer products
/// suffice.
///
/// Readings are within ±2048 counts, so each component is at most 2 of ±8.
pub fn clarke(readings: [AdcCounts; 3]) -> AlphaBeta<Current> {
    clarke_in(PhaseOrder::NORMAL, readings)
}

/// Clarke's transform in this phase order.
#[inline(always)] // in each period
pub fn clarke_in(order: PhaseOrder, [a, b, c]: [AdcCounts; 3]) -> AlphaBeta<Current> {
    let (a, b, c) = (a.to_bits(), b.to_bits(), c.to_bits());
    // (2a − b − c)/3 counts are (2a − b − c)/4096 units: 2^28 of them a unit.
    let alpha = 2 * a - (b + c);
    // (b − c)/√3 counts are (b − c)·√3/4096 units.
    let beta = I0F32::from_bits((b - c) << 2).top(order.root_3_quarter);
    AlphaBeta {
        alpha: Current::from_bits(alpha),
        beta: Current::from_bits(beta.to_bits()),
    }
}

/// Converts a twice-rotated vector to the control's voltages; it is within ±8.
#[inline(always)] // in each period
pub fn voltages(v: AlphaBeta<TurnedVoltage>) -> AlphaBeta<Voltage> {
    AlphaBeta {
        alpha: v.alpha.scaled(),
        beta: v.beta.scaled(),
    }
}

/// Park's transform (12): rotates a stator vector into the rotor's frame. Components saturate.
#[inline(always)] // in each period
pub fn park<T>(v: AlphaBeta<T>, SinCos { cos, sin }: SinCos) -> Dq<T>
where
    T: Number + TopProduct<I1F31, Output: Number>,
{
    // The sine uses one fraction bit.
    let double = |x: T::Output| T::from_bits(x.plus(x).to_bits());
    Dq {
        d: double(v.alpha.top(cos).plus_top(v.beta, sin)),
        q: double(v.beta.top(cos).minus_top(v.alpha, sin)),
    }
}

/// Inverse Park transform (11); the sine uses one fraction bit.
#[inline(always)] // in each period
pub fn inverse_park<T>(v: Dq<T>, SinCos { cos, sin }: SinCos) -> AlphaBeta<T::Output>
where
    T: Number + TopProduct<I1F31, Output: Number>,
{
    AlphaBeta {
        alpha: v.d.top(cos).minus_top(v.q, sin),
        beta: v.d.top(sin).plus_top(v.q, cos),
    }
}

/// Rotates a rotor-frame vector ahead by an angle; the sine uses one fraction bit.
#[inline(always)] // in each period
pub fn rotate<T>(v: Dq<T>, ahead: SinCos) -> Dq<T::Output>
where
    T: Number + TopProduct<I1F31, Output: Number>,
{
    let AlphaBeta { alpha, beta } = inverse_park(v, ahead);
    Dq { d: alpha, q: beta }
}

/// Returns a vector's three phase values (11).
#[inline(always)] // in each period
pub fn phases<T: Number>(v: AlphaBeta<T>) -> [T; 3] {
    phases_in(PhaseOrder::NORMAL, v)
}

/// Returns a vector's three phase values (11) in this phase order.
#[inline(always)] // in each period
pub fn phases_in<T: Number>(order: PhaseOrder, v: AlphaBeta<T>) -> [T; 3] {
    let alpha = v.alpha.to_bits();
    // √3/2 = 2·√3/4; the product keeps the top half.
    let product = i64::from(v.beta.to_bits()) * i64::from(order.root_3_quarter.to_bits());
    let beta = ((product >> 32) as i32) << 1;
    let half = alpha >> 1;
    [
        T::from_bits(alpha),
        T::from_bits(beta - half),
        T::from_bits(-beta - half),
    ]
}

/// Returns the vector as seen from a frame that leads by the angle. Components saturate.
pub fn rotate_frame<T>(v: Dq<T>, ahead: SinCos) -> Dq<T>
where
    T: Number + TopProduct<I1F31, Output: Number>,
{
    park(
        AlphaBeta {
            alpha: v.d,
            beta: v.q,
        },
        ahead,
    )
}

#[cfg(test)]
mod tests {
    use siskin_units::Angle;
    use siskin_units::math::sin_cos;

    use super::*;
    use core::f64::consts::TAU;

    /// Three readings of a balanced vector of this amplitude and angle.
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
            // 1365 counts at 4096/3 per unit; the table is up to 8e-5 short.
            assert!((v.d.to_num::<f64>() - 0.99976).abs() < 9e-5, "{v:?}");
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
                alpha: stator.alpha.scaled(),
                beta: stator.beta.scaled(),
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
