//! A motor as given by a file or a table.

use serde::Deserialize;

use super::choice::Choice;
use super::error::{BenchError, range};
use crate::plant::{Cogging, Drag, Extras, Harmonic, Motor, Winding};

/// Resistance of one phase, Ω. Ranges suit motors for ESCs of 1 to 200 A, so that a number with the wrong unit prefix
/// is out of range: 33 for 33 mΩ.
const R_OHM: [f64; 2] = [1e-3, 10.0];

/// Inductance of one phase, H.
const L_H: [f64; 2] = [5e-7, 1e-2];

/// Peak flux linkage of one phase, Wb: a hub motor of 10 rpm/V and 15 pole pairs has 18 % of the maximum.
const FLUX_WB: [f64; 2] = [1e-5, 0.2];

/// Inertia of the rotor, kg·m².
const J_KGM2: [f64; 2] = [0.0, 1.0];

/// Torque taken by friction, iron and detents, Nm.
const TORQUE_MAX_NM: f64 = 10.0;

/// The same per rad/s, Nms.
const VISCOUS_MAX_NMS: f64 = 1.0;

/// A motor in SI units.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotorTable {
    /// Its name in the library.
    #[serde(rename = "name")]
    _name: Option<String>,
    /// Phase resistance at 25 °C, Ω.
    #[serde(rename = "R")]
    r: f64,
    /// Phase inductance, H; or those of the rotor's axes.
    #[serde(rename = "L")]
    l: Option<f64>,
    #[serde(rename = "L_d")]
    l_d: Option<f64>,
    #[serde(rename = "L_q")]
    l_q: Option<f64>,
    /// Current along q at which the inductance has halved, A.
    saturation_a: Option<f64>,
    /// Peak phase flux linkage, Wb.
    flux: f64,
    pole_pairs: u32,
    /// Inertia of the rotor, kg·m².
    #[serde(rename = "J", default)]
    j: f64,
    /// Harmonics of the induced voltage.
    #[serde(default)]
    harmonics: Vec<HarmonicTable>,
    #[serde(default)]
    cogging_nm: f64,
    /// Detents per mechanical turn.
    #[serde(default)]
    cogging_order: u32,
    #[serde(default)]
    friction_nm: f64,
    #[serde(default)]
    viscous_nms: f64,
    #[serde(default)]
    hysteresis_nm: f64,
    #[serde(default)]
    eddy_nms: f64,
    /// How the winding heats up.
    winding: Option<WindingTable>,
}

/// A harmonic of the induced voltage.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct HarmonicTable {
    order: u32,
    /// Relative to the fundamental.
    share: f64,
    #[serde(default)]
    phase_deg: f64,
}

/// The winding's thermal mass.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct WindingTable {
    k_per_w: f64,
    j_per_k: f64,
}

impl Choice<MotorTable> {
    /// Returns the chosen motor, and its deviations from the ideal one.
    ///
    /// # Errors
    /// One line that names the motor or its key.
    pub fn motor(&self) -> Result<(Motor, Extras), BenchError> {
        let table = self.find("motor")?;
        Ok((table.motor()?, table.extras()?))
    }
}

impl MotorTable {
    fn motor(&self) -> Result<Motor, BenchError> {
        let [d, q] = self.inductances_h()?;
        let pairs = check("pole_pairs", f64::from(self.pole_pairs), [1.0, 64.0], "")?;
        Ok(Motor {
            resistance_ohm: check("R", self.r, R_OHM, "ohm")?,
            inductance_h: if d == q { d } else { 0.5 * (d + q) },
            flux_wb: check("flux", self.flux, FLUX_WB, "Wb")?,
            pole_pairs: pairs as u32,
            inertia_kgm2: check("J", self.j, J_KGM2, "kg m^2")?,
        })
    }

    fn inductances_h(&self) -> Result<[f64; 2], BenchError> {
        match (self.l, self.l_d, self.l_q) {
            (Some(l), None, None) => {
                let l = check("L", l, L_H, "H")?;
                Ok([l, l])
            }
            (None, Some(d), Some(q)) => {
                Ok([check("L_d", d, L_H, "H")?, check("L_q", q, L_H, "H")?])
            }
            _ => Err(BenchError::Inductances),
        }
    }

    fn extras(&self) -> Result<Extras, BenchError> {
        let [d, q] = self.inductances_h()?;
        let torque = |key, value| check(key, value, [0.0, TORQUE_MAX_NM], "Nm");
        let viscous = |key, value| check(key, value, [0.0, VISCOUS_MAX_NMS], "Nms");
        let saturation = |value| check("saturation_a", value, [1.0, 1e6], "A");
        // Without a torque there are no detents to count.
        let least = if self.cogging_nm > 0.0 { 1.0 } else { 0.0 };
        let order = f64::from(self.cogging_order);
        Ok(Extras {
            harmonics: self
                .harmonics
                .iter()
                .map(HarmonicTable::read)
                .collect::<Result<_, _>>()?,
            saliency: q / d,
            saturation_a: self.saturation_a.map_or(Ok(f64::INFINITY), saturation)?,
            drag: Drag {
                friction_nm: torque("friction_nm", self.friction_nm)?,
                viscous_nms: viscous("viscous_nms", self.viscous_nms)?,
                hysteresis_nm: torque("hysteresis_nm", self.hysteresis_nm)?,
                eddy_nms: viscous("eddy_nms", self.eddy_nms)?,
            },
            cogging: Cogging {
                torque_nm: torque("cogging_nm", self.cogging_nm)?,
                order: check("cogging_order", order, [least, 1e4], "detents a turn")? as u32,
            },
            winding: self.winding.as_ref().map(WindingTable::read).transpose()?,
        })
    }
}

impl HarmonicTable {
    fn read(&self) -> Result<Harmonic, BenchError> {
        let order = check("harmonics.order", f64::from(self.order), [2.0, 49.0], "")?;
        let phase_deg = check(
            "harmonics.phase_deg",
            self.phase_deg,
            [-360.0, 360.0],
            "degrees",
        )?;
        Ok(Harmonic {
            order: order as u32,
            share: check(
                "harmonics.share",
                self.share,
                [0.0, 1.0],
                "of the fundamental",
            )?,
            phase_rad: phase_deg.to_radians(),
        })
    }
}

impl WindingTable {
    fn read(&self) -> Result<Winding, BenchError> {
        Ok(Winding {
            resistance_k_per_w: check("winding.k_per_w", self.k_per_w, [1e-3, 1e3], "K/W")?,
            capacity_j_per_k: check("winding.j_per_k", self.j_per_k, [1e-2, 1e6], "J/K")?,
        })
    }
}

fn check(
    key: &'static str,
    value: f64,
    ends: [f64; 2],
    unit: &'static str,
) -> Result<f64, BenchError> {
    range("motor", key, value, ends, unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::assert_has_all;

    #[test]
    fn the_reference_has_every_key() {
        assert_has_all::<MotorTable>("`[bench.motor]`");
        assert_has_all::<HarmonicTable>("`[[bench.motor.harmonics]]`");
        assert_has_all::<WindingTable>("`[bench.motor.winding]`");
    }
}
