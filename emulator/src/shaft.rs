//! Converts the control's numbers to the shaft's, whatever the configured direction.

use siskin_control::drive::{Config, Direction};
use siskin_units::{Scale, Speed};

/// The units of the control's numbers on the bench, where a positive speed has the phases in the
/// order a, b, c.
#[derive(Clone, Copy, Debug)]
pub struct Units<'a> {
    /// The units along the configured direction.
    pub scale: &'a Scale,
    /// The configured direction.
    pub direction: Direction,
}

impl<'a> Units<'a> {
    /// Returns those of a configuration.
    pub const fn of(config: &'a Config) -> Self {
        Self {
            scale: &config.scale,
            direction: config.direction,
        }
    }

    /// Returns 1, or −1 if the configured direction has the phases in the order a, c, b.
    pub const fn sign(&self) -> f64 {
        match self.direction {
            Direction::Normal => 1.0,
            Direction::Reversed => -1.0,
        }
    }

    /// Converts a speed along the configured direction to the shaft's mechanical speed, rpm.
    pub fn rpm(&self, speed: Speed) -> f64 {
        self.sign() * f64::from(self.scale.rpm(speed))
    }
}
