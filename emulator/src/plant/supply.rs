//! The power source.

/// A source with its resistance, and the capacitor of the bus that it feeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supply {
    /// The source behind the resistance.
    pub source: Source,
    /// Internal resistance, Ω.
    pub resistance_ohm: f64,
    /// Inductance of the wires to the bus, H; some 1 µH per metre of both. 0 leaves it out.
    pub inductance_h: f64,
    /// The bus capacitor, F, above 0. A source without resistance that sinks current holds the bus
    /// without it; it counts once the source is disconnected.
    pub capacitance_f: f64,
}

/// A voltage source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source {
    /// A constant voltage, V.
    Fixed {
        /// Volts.
        volts: f64,
        /// Whether it sinks current. Most bench supplies do not: braking charges the capacitor.
        sinks: bool,
    },
    /// Lithium-polymer cells in series.
    Pack {
        /// Their number.
        cells: u32,
        /// Capacity, C (3600 to the Ah).
        capacity_c: f64,
        /// Remaining share of the capacity, 0..1.
        charge: f64,
    },
}

/// The capacitor of a small ESC's board, F.
pub const CAPACITANCE_F: f64 = 470e-6;

/// Capacity if only the number of cells is given, C: 2 Ah.
pub const CAPACITY_C: f64 = 2.0 * 3600.0;

/// Resistance of a cell of some 2 Ah, Ω.
pub const CELL_OHM: f64 = 4e-3;

/// Open-circuit volts of a lithium-polymer cell, from empty to full in steps of 5 %: the shape of
/// the published discharge tables of such packs.
const CELL_V: [f64; 21] = [
    3.27, 3.61, 3.69, 3.71, 3.73, 3.75, 3.77, 3.79, 3.80, 3.82, 3.84, 3.85, 3.87, 3.91, 3.95, 3.98,
    4.02, 4.08, 4.11, 4.15, 4.20,
];

impl Supply {
    /// Creates a bench supply whose voltage does not depend on the current, in either direction.
    pub const fn stiff(volts: f64) -> Self {
        Self {
            source: Source::Fixed { volts, sinks: true },
            resistance_ohm: 0.0,
            inductance_h: 0.0,
            capacitance_f: CAPACITANCE_F,
        }
    }

    /// Creates a charged lithium-polymer pack: 2 Ah, 4.2 V and 4 mΩ per cell.
    pub fn battery(cells: u32) -> Self {
        Self {
            source: Source::Pack {
                cells,
                capacity_c: CAPACITY_C,
                charge: 1.0,
            },
            resistance_ohm: CELL_OHM * f64::from(cells),
            inductance_h: 0.0,
            capacitance_f: CAPACITANCE_F,
        }
    }

    /// Returns the voltage without load once `drawn_c` coulombs have been drawn, V.
    pub fn open_v(&self, drawn_c: f64) -> f64 {
        match self.source {
            Source::Fixed { volts, .. } => volts,
            Source::Pack {
                cells,
                capacity_c,
                charge,
            } => f64::from(cells) * cell_v(charge - drawn_c / capacity_c),
        }
    }

    /// Returns true if current flows back into the source.
    pub fn sinks(&self) -> bool {
        match self.source {
            Source::Fixed { sinks, .. } => sinks,
            Source::Pack { .. } => true,
        }
    }
}

/// Returns a cell's open-circuit voltage by its remaining charge, V: linear between the curve's
/// points, and extrapolated beyond empty and full.
fn cell_v(charge: f64) -> f64 {
    let last = CELL_V.len() - 1;
    let place = charge * last as f64;
    let index = (place.max(0.0) as usize).min(last - 1);
    let (low, high) = (CELL_V[index], CELL_V[index + 1]);
    (low + (place - index as f64) * (high - low)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pack_is_full_flat_and_empty() {
        let pack = |charge| Supply {
            source: Source::Pack {
                cells: 4,
                capacity_c: 3600.0,
                charge,
            },
            ..Supply::battery(4)
        };
        assert!((pack(1.0).open_v(0.0) - 16.8).abs() < 1e-12);
        assert!((pack(0.0).open_v(0.0) - 13.08).abs() < 1e-12);
        // Half an ampere-hour of one.
        assert!((pack(1.0).open_v(1800.0) - 4.0 * 3.84).abs() < 1e-9);
        // Between two points, and beyond the ends.
        assert!((cell_v(0.525) - 3.845).abs() < 1e-9);
        assert!(cell_v(-0.05) < 3.0 && cell_v(-9.0) == 0.0 && cell_v(1.02) > 4.2);
    }
}
