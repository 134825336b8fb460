//! What can stand on the bench: motors, loads and supplies by name, from a file or written out.

use std::fmt;
use std::path::Path;

use serde::de::value::MapAccessDeserializer;
use serde::de::{DeserializeOwned, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use thiserror::Error;

use crate::plant::{Load, Motor, Supply};

/// Motors that are built in.
pub const MOTORS: [(&str, Motor); 1] = [(
    // Table I of the first paper. Its inertia is in the load's, as the paper gives only the sum.
    "antigravity-4006-kv380",
    Motor {
        resistance_ohm: 0.108,
        inductance_h: 30.6e-6,
        flux_wb: 1.3e-3,
        pole_pairs: 12,
        inertia_kgm2: 0.0,
    },
)];

/// Loads that are built in.
pub const LOADS: [(&str, Load); 2] = [
    (
        // Section V of the first paper: with the motor's own inertia.
        "cfprop-13x4.4",
        Load {
            c1: 1.25e-4,
            c2: 0.3e-6,
            torque_nm: 0.0,
            inertia_kgm2: 1.43e-4,
        },
    ),
    (
        // A bare shaft: the inertia of a 4006's bell, some 25 g at 18 mm.
        "none",
        Load {
            c1: 0.0,
            c2: 0.0,
            torque_nm: 0.0,
            inertia_kgm2: 8e-6,
        },
    ),
];

/// Why something cannot stand on the bench; one line.
#[derive(Debug, Error)]
pub enum BenchError {
    /// Neither a built-in name nor a file.
    #[error("{kind} {name}: not built in ({known}) and no such file")]
    Unknown {
        /// "motor" or "load".
        kind: &'static str,
        /// What was given.
        name: String,
        /// The built-in names.
        known: String,
    },
    /// A file that cannot be read or understood.
    #[error("{kind} file {path}: {reason}")]
    File {
        /// "motor" or "load".
        kind: &'static str,
        /// The file.
        path: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A quantity that no motor or load has.
    #[error("{kind}: {key} = {value} is out of range; {wanted}")]
    Range {
        /// "motor" or "load".
        kind: &'static str,
        /// The quantity.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What would do.
        wanted: &'static str,
    },
    /// A supply that is neither a voltage nor a pack.
    #[error("bus {0}: give volts above 0 and up to 70, or a pack from 1s to 14s, as 24 or 6s")]
    Bus(String),
}

/// A motor or load: a name, a file's path, or the thing itself.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice<T> {
    /// A built-in name or a path.
    Named(String),
    /// Written out.
    Inline(T),
}

/// A motor as a file or a table gives it, in SI units.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotorTable {
    /// Phase resistance, Ω.
    #[serde(rename = "R")]
    r: f64,
    /// Phase inductance, H.
    #[serde(rename = "L")]
    l: f64,
    /// Peak phase flux linkage, Wb.
    flux: f64,
    pole_pairs: u32,
    /// Inertia of the rotor, kg·m².
    #[serde(rename = "J", default)]
    j: f64,
}

/// A load as a file or a table gives it, in SI units.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadTable {
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

impl Choice<MotorTable> {
    /// The motor that was chosen.
    pub fn motor(&self) -> Result<Motor, BenchError> {
        let table = match self.find("motor", &MOTORS)? {
            Found::BuiltIn(motor) => return Ok(motor),
            Found::Table(table) => table,
        };
        let kind = "motor";
        positive(kind, "R", table.r, 1e-5, 1e3, "give 1e-5 to 1000 ohm")?;
        positive(kind, "L", table.l, 1e-8, 1.0, "give 1e-8 to 1 H")?;
        positive(kind, "flux", table.flux, 1e-6, 10.0, "give 1e-6 to 10 Wb")?;
        let pairs = f64::from(table.pole_pairs);
        positive(kind, "pole_pairs", pairs, 1.0, 64.0, "give 1 to 64")?;
        positive(kind, "J", table.j, 0.0, 1e3, "give 0 to 1000 kg m^2")?;
        Ok(Motor {
            resistance_ohm: table.r,
            inductance_h: table.l,
            flux_wb: table.flux,
            pole_pairs: table.pole_pairs,
            inertia_kgm2: table.j,
        })
    }
}

impl Choice<LoadTable> {
    /// The load that was chosen.
    pub fn load(&self) -> Result<Load, BenchError> {
        let table = match self.find("load", &LOADS)? {
            Found::BuiltIn(load) => return Ok(load),
            Found::Table(table) => table,
        };
        let kind = "load";
        positive(kind, "c1", table.c1, 0.0, 1e3, "give 0 to 1000 Nms")?;
        positive(kind, "c2", table.c2, 0.0, 1e3, "give 0 to 1000 Nms^2")?;
        positive(
            kind,
            "torque_nm",
            table.torque_nm,
            0.0,
            1e3,
            "give 0 to 1000 Nm",
        )?;
        positive(kind, "J", table.j, 0.0, 1e3, "give 0 to 1000 kg m^2")?;
        Ok(Load {
            c1: table.c1,
            c2: table.c2,
            torque_nm: table.torque_nm,
            inertia_kgm2: table.j,
        })
    }
}

/// `24`, `24.0` or `6s`.
pub fn supply(text: &str) -> Result<Supply, BenchError> {
    let wrong = || BenchError::Bus(text.to_owned());
    if let Some(cells) = text.strip_suffix(['s', 'S']) {
        let cells = cells.parse().ok().filter(|cells| (1..=14).contains(cells));
        return Ok(Supply::battery(cells.ok_or_else(wrong)?));
    }
    let volts = text.parse().ok();
    let volts = volts.filter(|volts: &f64| *volts > 0.0 && *volts <= 70.0);
    Ok(Supply::stiff(volts.ok_or_else(wrong)?))
}

enum Found<B, T> {
    BuiltIn(B),
    Table(T),
}

impl<T: DeserializeOwned + Copy> Choice<T> {
    fn find<B: Copy>(
        &self,
        kind: &'static str,
        built_in: &[(&str, B)],
    ) -> Result<Found<B, T>, BenchError> {
        let name = match self {
            Self::Inline(table) => return Ok(Found::Table(*table)),
            Self::Named(name) => name,
        };
        if let Some((_, found)) = built_in.iter().find(|(known, _)| known == name) {
            return Ok(Found::BuiltIn(*found));
        }
        if !Path::new(name).is_file() {
            let known: Vec<&str> = built_in.iter().map(|(known, _)| *known).collect();
            return Err(BenchError::Unknown {
                kind,
                name: name.clone(),
                known: known.join(", "),
            });
        }
        let failed = |reason: String| BenchError::File {
            kind,
            path: name.clone(),
            reason,
        };
        let text = std::fs::read_to_string(name).map_err(|error| failed(error.to_string()))?;
        let table = toml::from_str(&text);
        Ok(Found::Table(
            table.map_err(|error| failed(toml_reason(&text, &error)))?,
        ))
    }
}

/// A TOML error in one line, with the line of the text that it is about.
pub fn toml_reason(text: &str, error: &toml::de::Error) -> String {
    let message = error.message().replace('\n', " ");
    match error.span() {
        Some(span) => {
            let before = &text[..span.start.min(text.len())];
            let line = before.matches('\n').count() + 1;
            format!("line {line}: {message}")
        }
        None => message,
    }
}

fn positive(
    kind: &'static str,
    key: &'static str,
    value: f64,
    least: f64,
    most: f64,
    wanted: &'static str,
) -> Result<(), BenchError> {
    if (least..=most).contains(&value) {
        Ok(())
    } else {
        Err(BenchError::Range {
            kind,
            key,
            value,
            wanted,
        })
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Choice<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either<T>(std::marker::PhantomData<T>);

        impl<'de, T: Deserialize<'de>> Visitor<'de> for Either<T> {
            type Value = Choice<T>;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a name, a path or a table")
            }

            fn visit_str<E>(self, name: &str) -> Result<Self::Value, E> {
                Ok(Choice::Named(name.to_owned()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map)).map(Choice::Inline)
            }
        }

        deserializer.deserialize_any(Either(std::marker::PhantomData))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_names_are_found_and_others_say_what_there_is() {
        let named = |name: &str| Choice::<MotorTable>::Named(name.to_owned());
        assert_eq!(
            named("antigravity-4006-kv380").motor().unwrap(),
            MOTORS[0].1
        );
        let error = named("nosuch").motor().unwrap_err().to_string();
        assert!(
            error.contains("nosuch") && error.contains("antigravity"),
            "{error}"
        );
    }

    #[test]
    fn tables_are_checked() {
        let choice = |text: &str| {
            #[derive(Deserialize)]
            struct Holder {
                motor: Choice<MotorTable>,
            }
            toml::from_str::<Holder>(text).map(|holder| holder.motor)
        };
        let motor = choice("motor = { R = 0.1, L = 2e-5, flux = 1e-3, pole_pairs = 7 }").unwrap();
        assert_eq!(motor.motor().unwrap().pole_pairs, 7);
        let motor = choice("motor = { R = -1.0, L = 2e-5, flux = 1e-3, pole_pairs = 7 }").unwrap();
        assert!(motor.motor().unwrap_err().to_string().contains("R = -1"));
        let text = "\nmotor = { R = 0.1, K = 1 }";
        let error = choice(text).unwrap_err();
        let reason = toml_reason(text, &error);
        assert!(
            reason.contains("line 2") && reason.contains('K'),
            "{reason}"
        );
    }

    #[test]
    fn supplies_are_volts_or_cells() {
        assert_eq!(supply("24").unwrap(), Supply::stiff(24.0));
        assert!((supply("6s").unwrap().open_v - 25.2).abs() < 1e-9);
        for wrong in ["0", "-3", "nan", "15s", "s", "many"] {
            assert!(supply(wrong).is_err(), "{wrong}");
        }
    }
}
