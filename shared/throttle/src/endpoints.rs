//! Maps a pulse's width to throttle.

use siskin_units::math::quotient;

use super::signal::Pulse;
use super::{Share, reverse};

const NS_PER_US: u32 = 1000;

/// What the wire demands of the motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Demand {
    /// Do not turn; also DShot's stop and commands.
    Zero,
    /// Turn.
    Throttle(Share),
}

/// The reciprocal of the share of the range that is zero at its lower end: 2 %.
pub const ZERO_DIVISOR: u32 = 50;

/// The reciprocal of the share of the range that is zero on either side of the centre, with two directions:
/// 4 %. Twice that at an end, because a stick's spring centres it less exactly than an end stop, and within the
/// ±5 % that flight controllers leave free there.
const CENTRE_DIVISOR: u32 = 25;

/// Servo pulse widths of no throttle and full throttle; in 3D, of full reverse and full forward. Other pulse
/// kinds are measured by their equivalent servo pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EndPoints {
    /// Lower end, µs.
    pub min_us: u16,
    /// Upper end, µs, above the lower.
    pub max_us: u16,
}

impl Pulse {
    /// Returns the equivalent servo pulse width, ns: 1000 to 2000 µs for this kind's 125 to 250, 42 to 84 or 5
    /// to 25 µs.
    pub const fn servo_ns(self, width_ns: u32) -> u32 {
        match self {
            Self::Servo => width_ns,
            Self::OneShot125 => width_ns.saturating_mul(8),
            Self::OneShot42 => width_ns.saturating_mul(500) / 21,
            Self::Multishot => width_ns.saturating_mul(50).saturating_add(750_000),
        }
    }

    /// Returns this kind's width for a servo pulse width, ns: the inverse of [`Pulse::servo_ns`], rounded down
    /// to a nanosecond.
    pub const fn width_ns(self, servo_ns: u32) -> u32 {
        match self {
            Self::Servo => servo_ns,
            Self::OneShot125 => servo_ns / 8,
            Self::OneShot42 => (servo_ns as u64 * 21 / 500) as u32,
            Self::Multishot => servo_ns.saturating_sub(750_000) / 50,
        }
    }
}

impl EndPoints {
    /// Returns the demand of a pulse, clamped at the ends.
    pub fn demand(self, kind: Pulse, width_ns: u32, two_directions: bool) -> Demand {
        let width_ns = kind.servo_ns(width_ns);
        let min_ns = u32::from(self.min_us) * NS_PER_US;
        let max_ns = u32::from(self.max_us) * NS_PER_US;
        let range_ns = max_ns - min_ns;
        if !two_directions {
            return match above(width_ns, min_ns + range_ns / ZERO_DIVISOR, max_ns) {
                Some(share) => Demand::Throttle(share),
                None => Demand::Zero,
            };
        }
        let middle_ns = min_ns + range_ns / 2;
        let band_ns = range_ns / CENTRE_DIVISOR;
        let forward = above(width_ns, middle_ns + band_ns, max_ns);
        // Mirrored at the middle, both sides are computed the same way.
        let mirrored_ns = (2 * middle_ns).saturating_sub(width_ns);
        let back = above(mirrored_ns, middle_ns + band_ns, max_ns);
        match (forward, back) {
            (Some(share), _) => Demand::Throttle(share),
            (None, Some(share)) => Demand::Throttle(reverse(share)),
            (None, None) => Demand::Zero,
        }
    }
}

/// Returns where a width lies between the widest zero and full throttle; `None` at zero.
fn above(width_ns: u32, zero_ns: u32, full_ns: u32) -> Option<Share> {
    let over_ns = width_ns.min(full_ns).checked_sub(zero_ns)?;
    if over_ns == 0 {
        return None;
    }
    let share = quotient(u64::from(over_ns) << Share::FRAC_NBITS, full_ns - zero_ns);
    Some(Share::from_bits(share.min(i32::MAX as u32) as i32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const USUAL: EndPoints = EndPoints {
        min_us: 1000,
        max_us: 2000,
    };

    fn share(ends: EndPoints, width_ns: u32, two_directions: bool) -> Option<f64> {
        match ends.demand(Pulse::Servo, width_ns, two_directions) {
            Demand::Zero => None,
            Demand::Throttle(throttle) => Some(throttle.to_num()),
        }
    }

    #[test]
    fn up_to_two_percent_is_zero_and_from_there_it_is_linear() {
        for (width_ns, wanted) in [
            (0, None),
            (800_000, None),
            (1_000_000, None),
            (1_020_000, None),
            (1_020_001, Some(1e-6 / 0.98)),
            (1_265_000, Some(0.25)),
            (1_510_000, Some(0.5)),
            (2_000_000, Some(1.0)),
            (2_200_000, Some(1.0)),
            (u32::MAX, Some(1.0)),
        ] {
            let found = share(USUAL, width_ns, false);
            assert_eq!(found.is_some(), wanted.is_some(), "{width_ns}");
            let error = found.unwrap_or(0.0) - wanted.unwrap_or(0.0);
            assert!(error.abs() < 1e-8, "{width_ns}: {error}");
        }
    }

    #[test]
    fn other_end_points_move_the_ends() {
        let ends = EndPoints {
            min_us: 1100,
            max_us: 1900,
        };
        assert_eq!(share(ends, 1_116_000, false), None);
        assert!((share(ends, 1_508_000, false).expect("open") - 0.5).abs() < 1e-6);
        assert!((share(ends, 1_900_000, false).expect("open") - 1.0).abs() < 1e-6);
    }

    #[test]
    fn in_3d_the_middle_is_zero_and_both_sides_are_linear() {
        for (width_ns, wanted) in [
            (800_000, Some(-1.0)),
            (1_000_000, Some(-1.0)),
            (1_230_000, Some(-0.5)),
            (1_459_999, Some(0.0)),
            (1_460_000, None),
            (1_500_000, None),
            (1_540_000, None),
            (1_540_001, Some(0.0)),
            (1_770_000, Some(0.5)),
            (2_000_000, Some(1.0)),
            (u32::MAX, Some(1.0)),
        ] {
            let found = share(USUAL, width_ns, true);
            assert_eq!(found.is_some(), wanted.is_some(), "{width_ns}");
            let error = found.unwrap_or(0.0) - wanted.unwrap_or(0.0);
            assert!(error.abs() < 3e-6, "{width_ns}: {error}");
        }
        // The smallest reverse throttle still has its direction.
        assert!(matches!(
            USUAL.demand(Pulse::Servo, 1_459_999, true),
            Demand::Throttle(throttle) if throttle.is_negative()
        ));
    }

    #[test]
    fn every_kind_has_its_own_range() {
        for (kind, low_ns, high_ns) in [
            (Pulse::Servo, 1_000_000, 2_000_000),
            (Pulse::OneShot125, 125_000, 250_000),
            (Pulse::OneShot42, 42_000, 84_000),
            (Pulse::Multishot, 5_000, 25_000),
        ] {
            assert_eq!(kind.servo_ns(low_ns), 1_000_000, "{kind:?}");
            assert_eq!(kind.servo_ns(high_ns), 2_000_000, "{kind:?}");
            assert_eq!(kind.width_ns(1_000_000), low_ns, "{kind:?}");
            assert_eq!(kind.width_ns(2_000_000), high_ns, "{kind:?}");
            assert_eq!(USUAL.demand(kind, low_ns, false), Demand::Zero);
            let full = Demand::Throttle(Share::MAX);
            assert_eq!(USUAL.demand(kind, high_ns, false), full);
        }
    }

    proptest! {
        /// A wider pulse never asks for less, whatever the end points.
        #[test]
        fn throttle_grows_with_the_width(
            min_us in 800_u16..=1400,
            max_us in 1500_u16..=2200,
            width_ns in 0_u32..3_000_000,
            more_ns in 0_u32..100_000,
            two_directions: bool,
        ) {
            let value = |width_ns| match (EndPoints { min_us, max_us }).demand(
                Pulse::Servo, width_ns, two_directions,
            ) {
                Demand::Zero => -0.5 / f64::from(1_u32 << 31),
                Demand::Throttle(throttle) => throttle.to_num::<f64>(),
            };
            prop_assert!(value(width_ns + more_ns) >= value(width_ns));
        }
    }
}
