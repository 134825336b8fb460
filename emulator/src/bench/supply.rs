//! A supply as given by a word, a file or a table.

use serde::Deserialize;

use super::choice::Choice;
use super::error::{BenchError, range};
use super::word::{CELLS_MAX, word};
use crate::plant::{CAPACITANCE_F, CAPACITY_C, CELL_OHM, Source, Supply};

/// A supply: `volts` or `cells`, and its other properties.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SupplyTable {
    /// A constant voltage source, V.
    volts: Option<f64>,
    /// Whether it sinks current; default true.
    sinks: Option<bool>,
    /// A lithium-polymer pack of this many cells in series.
    cells: Option<u32>,
    capacity_ah: Option<f64>,
    /// Remaining share of the capacity, 0..1.
    charge: Option<f64>,
    /// Resistance of the whole source; default 4 per cell, or none.
    resistance_mohm: Option<f64>,
    /// Inductance of the wires to the bus; default none.
    inductance_uh: Option<f64>,
    /// Capacitance of the bus; default 470.
    capacitance_uf: Option<f64>,
}

impl Choice<SupplyTable> {
    /// Returns the chosen supply: volts, a pack as `6s`, a file or a table.
    ///
    /// # Errors
    /// One line that names what was given or its key.
    pub fn supply(&self) -> Result<Supply, BenchError> {
        if let Self::Named(text) = self {
            if let Some(supply) = word(text) {
                return Ok(supply);
            }
            if !std::path::Path::new(text).is_file() {
                return Err(BenchError::Bus(text.clone()));
            }
        }
        self.find("bus")?.supply()
    }
}

impl SupplyTable {
    fn supply(&self) -> Result<Supply, BenchError> {
        let check = |key, value, ends, unit| range("bus", key, value, ends, unit);
        let (source, usual_ohm) = match (self.volts, self.cells) {
            (Some(volts), None) if self.capacity_ah.is_none() && self.charge.is_none() => {
                let volts = check("volts", volts, [0.1, 70.0], "V")?;
                let sinks = self.sinks.unwrap_or(true);
                (Source::Fixed { volts, sinks }, 0.0)
            }
            (None, Some(cells)) if self.sinks.is_none() => {
                let ends = [1.0, f64::from(CELLS_MAX)];
                let number = check("cells", f64::from(cells), ends, "")?;
                let capacity_c = match self.capacity_ah {
                    Some(ah) => 3600.0 * check("capacity_ah", ah, [0.001, 1e4], "Ah")?,
                    None => CAPACITY_C,
                };
                let charge = self.charge.unwrap_or(1.0);
                let charge = check("charge", charge, [0.0, 1.0], "of the capacity")?;
                let pack = Source::Pack {
                    cells,
                    capacity_c,
                    charge,
                };
                (pack, CELL_OHM * number)
            }
            _ => return Err(BenchError::Source),
        };
        let milliohm = self.resistance_mohm;
        let microfarad = self.capacitance_uf;
        Ok(Supply {
            source,
            resistance_ohm: match milliohm {
                Some(mohm) => 1e-3 * check("resistance_mohm", mohm, [0.0, 1e5], "mOhm")?,
                None => usual_ohm,
            },
            inductance_h: match self.inductance_uh {
                Some(uh) => 1e-6 * check("inductance_uh", uh, [0.0, 1e3], "uH")?,
                None => 0.0,
            },
            capacitance_f: match microfarad {
                Some(uf) => 1e-6 * check("capacitance_uf", uf, [1.0, 1e7], "uF")?,
                None => CAPACITANCE_F,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::assert_has_all;

    #[test]
    fn the_reference_has_every_key() {
        assert_has_all::<SupplyTable>("`[bench.bus]`");
    }

    fn supply(toml: &str) -> Result<Supply, BenchError> {
        #[derive(Deserialize)]
        struct Holder {
            bus: Choice<SupplyTable>,
        }
        let holder: Holder = toml::from_str(&format!("bus = {toml}")).unwrap();
        holder.bus.supply()
    }

    #[test]
    fn supplies_are_volts_cells_or_tables() {
        for text in ["24", "24.0", "'24'", "{ volts = 24.0 }"] {
            assert_eq!(supply(text).unwrap(), Supply::stiff(24.0), "{text}");
        }
        for text in ["'6s'", "'6S'", "{ cells = 6 }"] {
            assert_eq!(supply(text).unwrap(), Supply::battery(6), "{text}");
        }
        let table = "{ volts = 20.0, sinks = false, resistance_mohm = 50, inductance_uh = 2, capacitance_uf = 1000 }";
        let wanted = Supply {
            source: Source::Fixed {
                volts: 20.0,
                sinks: false,
            },
            resistance_ohm: 0.05,
            inductance_h: 2e-6,
            capacitance_f: 1e-3,
        };
        assert_eq!(supply(table).unwrap(), wanted);
        let pack = supply("{ cells = 4, capacity_ah = 1.5, charge = 0.9 }").unwrap();
        assert!((pack.open_v(0.0) - 4.0 * 4.11).abs() < 1e-9);
        assert!((pack.open_v(0.4 * 5400.0) - 4.0 * 3.84).abs() < 1e-9);
    }

    #[test]
    fn what_is_no_supply_is_named() {
        for (text, word) in [
            ("0", "0"),
            ("-3", "-3"),
            ("nan", "NaN"),
            ("'15s'", "15s"),
            ("'s'", "s"),
            ("'many'", "many"),
            ("{ volts = 99.0 }", "volts = 99"),
            ("{ cells = 0 }", "cells = 0"),
            ("{ cells = 4, charge = 1.5 }", "charge = 1.5"),
            ("{ cells = 4, volts = 12.0 }", "volts or cells"),
            ("{ cells = 4, sinks = false }", "sinks"),
            ("{ volts = 12.0, charge = 0.5 }", "charge"),
            ("{ volts = 12.0, capacitance_uf = 0 }", "capacitance_uf = 0"),
            ("{ cells = 4, inductance_uh = -1 }", "inductance_uh = -1"),
        ] {
            let error = supply(text).unwrap_err().to_string();
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
