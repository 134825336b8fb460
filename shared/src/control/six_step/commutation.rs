//! The six sextants: each leg's role, and the rotor's position meanwhile.

use siskin_units::{Angle, traced};

traced! {
    /// A sextant, named after the switching leg and the leg held low. The current vector stands at 30°, 90° and so
    /// on, a quarter turn ahead of the rotor mid-sextant.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[repr(u8)]
    pub enum Sector {
        /// Current from a to c; rotor within 30° of 300°.
        Ac,
        /// From b to c; around 0°.
        Bc,
        /// From b to a; around 60°.
        Ba,
        /// From c to a; around 120°.
        Ca,
        /// From c to b; around 180°.
        Cb,
        /// From a to b; around 240°.
        Ab,
    }
}

/// One value per leg, by the leg's role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Legs<T> {
    /// The switching leg: both switches alternate, so the current may flow either way.
    pub switching: T,
    /// The leg whose low side is on.
    pub low: T,
    /// The leg with both switches off.
    pub floating: T,
}

/// A sixth of a turn.
pub const SEXTANT: Angle = Angle::from_bits(715_827_883);

/// From mid-sextant to its end.
pub const HALF_SEXTANT: Angle = Angle::from_bits(357_913_941);

impl Sector {
    /// Returns the next sextant in forward rotation.
    pub const fn next(self) -> Self {
        match self {
            Self::Ac => Self::Bc,
            Self::Bc => Self::Ba,
            Self::Ba => Self::Ca,
            Self::Ca => Self::Cb,
            Self::Cb => Self::Ab,
            Self::Ab => Self::Ac,
        }
    }

    /// Returns true if the floating phase's back-EMF rises through zero; rising and falling sextants alternate.
    ///
    /// At the start of a rising sextant the low leg has changed and the switching leg stays; at the start of a
    /// falling one it is the other way round.
    pub const fn rising(self) -> bool {
        matches!(self, Self::Ac | Self::Ba | Self::Cb)
    }

    /// Returns the rotor angle at which the floating phase's back-EMF is zero.
    ///
    /// Phase a's flux peaks at 0°, so its back-EMF is −ω·φ·sin θ: it falls through zero at 0°, where a floats.
    pub const fn middle(self) -> Angle {
        Angle::from_bits((self as i32 - 1).wrapping_mul(SEXTANT.to_bits()))
    }

    /// Returns the sextant of a rotor at this angle.
    pub const fn at(theta: Angle) -> Self {
        // The first sextant begins at −90°. The top word of six times the angle counts sextants.
        let from_first = (theta.to_bits() as u32).wrapping_add(1 << 30);
        match ((from_first as u64 * 6) >> 32) as u32 {
            0 => Self::Ac,
            1 => Self::Bc,
            2 => Self::Ba,
            3 => Self::Ca,
            4 => Self::Cb,
            _ => Self::Ab,
        }
    }

    /// Sorts the values of phases a, b, c by their legs' roles.
    pub fn legs<T>(self, [a, b, c]: [T; 3]) -> Legs<T> {
        let (switching, low, floating) = match self {
            Self::Ac => (a, c, b),
            Self::Bc => (b, c, a),
            Self::Ba => (b, a, c),
            Self::Ca => (c, a, b),
            Self::Cb => (c, b, a),
            Self::Ab => (a, b, c),
        };
        Legs {
            switching,
            low,
            floating,
        }
    }

    /// Returns each leg's value, ordered as phases a, b, c.
    pub fn phases<T>(self, legs: Legs<T>) -> [T; 3] {
        let Legs {
            switching: s,
            low: l,
            floating: f,
        } = legs;
        match self {
            Self::Ac => [s, f, l],
            Self::Bc => [f, s, l],
            Self::Ba => [l, s, f],
            Self::Ca => [l, f, s],
            Self::Cb => [f, l, s],
            Self::Ab => [s, l, f],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    const ALL: [Sector; 6] = [
        Sector::Ac,
        Sector::Bc,
        Sector::Ba,
        Sector::Ca,
        Sector::Cb,
        Sector::Ab,
    ];

    /// Back-EMFs of the phases over ω·φ.
    fn emf(turns: f64) -> [f64; 3] {
        [0.0, 1.0, 2.0].map(|phase| -(TAU * (turns - phase / 3.0)).sin())
    }

    #[test]
    fn a_turn_has_six_sextants_a_sixth_apart() {
        for sector in ALL {
            let step = sector.next().middle().wrapping_sub(sector.middle());
            assert!((step.to_num::<f64>() - 1.0 / 6.0).abs() < 1e-8);
            assert_ne!(sector.rising(), sector.next().rising());
        }
        let around = ALL.iter().fold(Sector::Ac, |sector, _| sector.next());
        assert_eq!(around, Sector::Ac);
    }

    #[test]
    fn what_legs_takes_apart_phases_puts_together() {
        for sector in ALL {
            assert_eq!(sector.phases(sector.legs([1, 2, 3])), [1, 2, 3]);
        }
    }

    #[test]
    fn the_floating_phase_crosses_zero_in_the_middle_in_the_stated_direction() {
        for sector in ALL {
            let middle = sector.middle().to_num::<f64>();
            let floating = |turns| sector.legs(emf(turns)).floating;
            assert!(floating(middle).abs() < 1e-7, "{sector:?}");
            let before = floating(middle - 1.0 / 12.0);
            assert!((before + 0.5 * if sector.rising() { 1.0 } else { -1.0 }).abs() < 1e-6);
        }
    }

    #[test]
    fn a_rotor_is_in_the_sextant_whose_middle_is_within_30_degrees() {
        for sector in ALL {
            for degrees in -29..=29 {
                let theta = sector.middle().to_num::<f64>() + f64::from(degrees) / 360.0;
                assert_eq!(Sector::at(Angle::wrapping_from_num(theta)), sector);
            }
        }
    }

    #[test]
    fn the_other_two_have_the_most_back_emf_between_them() {
        for sector in ALL {
            for hundredth in -8..=8 {
                let turns = sector.middle().to_num::<f64>() + f64::from(hundredth) / 100.0;
                let legs = sector.legs(emf(turns));
                let between = legs.switching - legs.low;
                // √3·cos 30° at the ends.
                assert!(between > 1.5, "{sector:?} {turns}: {between}");
            }
        }
    }

    #[test]
    fn the_leg_that_goes_on_is_the_one_stated() {
        for sector in ALL {
            let (now, next) = (sector.legs([0, 1, 2]), sector.next().legs([0, 1, 2]));
            if sector.next().rising() {
                assert_eq!(now.switching, next.switching);
            } else {
                assert_eq!(now.low, next.low);
            }
        }
    }
}
