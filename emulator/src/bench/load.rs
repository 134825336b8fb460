//! A load as a file or a table gives it.

use serde::Deserialize;

use super::{BenchError, Choice, range};
use crate::plant::Load;

/// A load in SI units.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadTable {
    /// What it is known by in the library.
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
    /// The load that was chosen.
    ///
    /// # Errors
    /// One line that names the load or its key.
    pub fn load(&self) -> Result<Load, BenchError> {
        let table = self.find("load")?;
        let check = |key, value, unit| range("load", key, value, [0.0, 1e3], unit);
        Ok(Load {
            c1: check("c1", table.c1, "Nms")?,
            c2: check("c2", table.c2, "Nms^2")?,
            torque_nm: check("torque_nm", table.torque_nm, "Nm")?,
            inertia_kgm2: check("J", table.j, "kg m^2")?,
        })
    }
}
