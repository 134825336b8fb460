//! Where the power comes from.

/// A voltage source behind a resistance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supply {
    /// Voltage without load, V.
    pub open_v: f64,
    /// Internal resistance, Ω.
    pub resistance_ohm: f64,
}

impl Supply {
    /// A bench supply: its voltage does not depend on the current.
    pub const fn stiff(volts: f64) -> Self {
        Self {
            open_v: volts,
            resistance_ohm: 0.0,
        }
    }

    /// A charged lithium-polymer pack: 4.2 V and 4 mΩ a cell, as a pack of some 2 Ah has.
    pub fn battery(cells: u32) -> Self {
        Self {
            open_v: 4.2 * f64::from(cells),
            resistance_ohm: 4e-3 * f64::from(cells),
        }
    }

    /// Terminal voltage at a current drawn, V, never negative.
    pub fn voltage(&self, current_a: f64) -> f64 {
        (self.open_v - self.resistance_ohm * current_a).max(0.0)
    }
}
