//! Changes around a rack's ESCs.

use std::f64::consts::TAU;
use std::ops::RangeInclusive;

use thiserror::Error;

/// Changes around the ESCs; `None` leaves a quantity unchanged.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Environment {
    /// Open-circuit voltage of the supply, V, 0 to 100: it replaces a battery's, which then never runs empty.
    pub supply_v: Option<f64>,
    /// Resistance of the supply, Ω, 0 to 100.
    pub supply_ohm: Option<f64>,
    /// Temperature of the air, °C, -60 to 150.
    pub ambient_c: Option<f64>,
    /// One per ESC, in order from the first.
    pub shafts: Vec<Shaft>,
}

/// What acts on one ESC's shaft besides its load; `None` leaves it unchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shaft {
    /// Torque, Nm, ±100; positive turns it with the phases in the order a, b, c.
    pub torque_nm: Option<f64>,
    /// Air speed, as the speed at which it would turn a free propeller, rpm, ±100 000.
    pub wind_rpm: Option<f64>,
}

/// A quantity out of range.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{what} = {value} is out of range; give {} to {}", range.start(), range.end())]
pub struct OutOfRange {
    what: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
}

impl Environment {
    /// Checks that everything in it is in range.
    ///
    /// # Errors
    /// The first quantity that is not.
    pub fn check(&self) -> Result<(), OutOfRange> {
        check("voltage of the supply", self.supply_v, 0.0..=100.0)?;
        check("resistance of the supply", self.supply_ohm, 0.0..=100.0)?;
        check("temperature of the air", self.ambient_c, -60.0..=150.0)?;
        self.shafts.iter().try_for_each(|shaft| {
            check("torque", shaft.torque_nm, -100.0..=100.0)?;
            check("air speed", shaft.wind_rpm, -1e5..=1e5)
        })
    }
}

impl Shaft {
    /// Returns the air speed, rad/s.
    pub(super) fn wind_rad_s(&self) -> Option<f64> {
        self.wind_rpm.map(|rpm| rpm * TAU / 60.0)
    }
}

fn check(
    what: &'static str,
    value: Option<f64>,
    range: RangeInclusive<f64>,
) -> Result<(), OutOfRange> {
    match value {
        Some(value) if !range.contains(&value) => Err(OutOfRange { what, value, range }),
        _ => Ok(()),
    }
}
