//! A load as given by a file or a table.

use serde::Deserialize;

use super::choice::Choice;
use super::error::{BenchError, range};
use crate::plant::Load;

/// A load in SI units.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadTable {
    /// Its name in the library.
    #[serde(rename = "name")]
    _name: Option<String>,
    #[serde(default)]
    c1: f64,
    #[serde(default)]
    c2: f64,
    #[serde(default)]
    torque_nm: f64,
    /// Inertia, kg·m².
    #[serde(rename = "J", default)]
    j: f64,
}

impl Choice<LoadTable> {
    /// Returns the chosen load.
    ///
    /// # Errors
    /// One line that names the load or its key.
    pub fn load(&self) -> Result<Load, BenchError> {
        let table = self.find("load")?;
        // What such an ESC turns, up to a vehicle's wheel; numbers in wrong units are beyond.
        let check = |key, value, most, unit| range("load", key, value, [0.0, most], unit);
        Ok(Load {
            c1: check("c1", table.c1, 1.0, "Nms")?,
            c2: check("c2", table.c2, 0.1, "Nms^2")?,
            torque_nm: check("torque_nm", table.torque_nm, 100.0, "Nm")?,
            inertia_kgm2: check("J", table.j, 20.0, "kg m^2")?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::assert_has_all;

    #[test]
    fn the_reference_has_every_key() {
        assert_has_all::<LoadTable>("`[bench.load]`");
    }
}
