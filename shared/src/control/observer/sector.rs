//! The sixths of an electrical turn that the signs of three fluxes distinguish (second paper, figures 22 and 24),
//! shared by flux crossings and Hall sensors.

use siskin_units::{Angle, traced};

traced! {
    /// One of six sectors of 60°, numbered in the positive direction. The middle of the first is at 0°, where the
    /// rotor's flux lies along phase a.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Sector(u8);
}

/// The zero crossing at which a sector begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Phase whose flux crosses zero: 0, 1 or 2.
    pub phase: usize,
    /// The flux becomes positive.
    pub rising: bool,
}

/// Signs of the fluxes per sector, bits 0, 1, 2 for phases a, b, c: set while positive.
const CODES: [u8; 6] = [0b001, 0b011, 0b010, 0b110, 0b100, 0b101];

/// 2^32/6: a sector as an angle.
const SIXTH_TURN: u32 = 715_827_883;

/// 2^32/12.
const TWELFTH_TURN: u32 = 357_913_941;

impl Sector {
    /// Half a sector: the largest distance of the rotor from its sector's middle.
    pub const HALF: Angle = Angle::from_bits(TWELFTH_TURN as i32);

    /// Returns the sector of an angle.
    pub fn of(theta: Angle) -> Self {
        let from_edge = (theta.to_bits() as u32).wrapping_add(TWELFTH_TURN);
        Self(((u64::from(from_edge) * 6) >> 32) as u8)
    }

    /// Returns the sector with these signs; `None` if all are equal.
    pub fn of_code(code: u8) -> Option<Self> {
        let index = CODES.iter().position(|known| *known == code)?;
        Some(Self(index as u8))
    }

    /// Returns the signs of the sector's fluxes.
    pub fn code(self) -> u8 {
        CODES[usize::from(self.0 % 6)]
    }

    /// Returns the next sector in the positive direction.
    pub fn next(self) -> Self {
        Self(if self.0 >= 5 { 0 } else { self.0 + 1 })
    }

    /// Returns the number of forward steps from this sector to `there`, 0 to 5.
    pub fn steps_to(self, there: Self) -> u8 {
        (there.0 + 6 - self.0) % 6
    }

    /// Returns the angle at which the sector begins.
    pub fn begin(self) -> Angle {
        self.middle().wrapping_sub(Self::HALF)
    }

    /// Returns the angle of the sector's middle.
    pub fn middle(self) -> Angle {
        Angle::from_bits(u32::from(self.0).wrapping_mul(SIXTH_TURN) as i32)
    }

    /// Returns the crossing at which the sector begins.
    pub fn edge(self) -> Edge {
        Edge {
            // c, b, a, c, b, a; every other one rises.
            phase: usize::from(2 - self.0 % 3),
            rising: self.0 & 1 == 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn fluxes(degrees: f64) -> [f64; 3] {
        [0.0, -1.0, 1.0].map(|third| (TAU * (degrees / 360.0 + third / 3.0)).cos())
    }

    fn angle(degrees: f64) -> Angle {
        Angle::wrapping_from_num(degrees / 360.0)
    }

    #[test]
    fn the_signs_of_the_fluxes_are_the_code_of_the_sector() {
        for degrees in 0..360 {
            let degrees = f64::from(degrees) + 0.5;
            let sector = Sector::of(angle(degrees));
            let positive = fluxes(degrees).map(|flux| u8::from(flux > 0.0));
            let code = positive[0] | positive[1] << 1 | positive[2] << 2;
            assert_eq!(sector.code(), code, "{degrees}");
            assert_eq!(Sector::of_code(code), Some(sector), "{degrees}");
            let from_middle = angle(degrees).wrapping_sub(sector.middle());
            assert!(from_middle.abs() <= Sector::HALF, "{degrees}");
        }
        assert_eq!(Sector::of_code(0), None);
        assert_eq!(Sector::of_code(7), None);
    }

    #[test]
    fn each_sector_begins_with_its_edge() {
        for index in 0..6 {
            let sector = Sector(index);
            let Edge { phase, rising } = sector.edge();
            let degrees = sector.begin().to_num::<f64>() * 360.0;
            let (before, after) = (fluxes(degrees - 1.0)[phase], fluxes(degrees + 1.0)[phase]);
            assert!(before * after < 0.0, "{sector:?}");
            assert_eq!(after > 0.0, rising, "{sector:?}");
            assert_eq!(Sector::of(angle(degrees + 1.0)), sector);
            assert_eq!(sector.steps_to(sector.next()), 1);
        }
    }
}
