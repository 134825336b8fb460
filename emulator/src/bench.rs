//! What can stand on the bench: motors, loads and supplies by name, from a file or written out.

pub mod library;
mod load;
mod motor;
mod set_up;
mod supply;

use std::fmt;
use std::path::Path;

use serde::de::value::MapAccessDeserializer;
use serde::de::{DeserializeOwned, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use thiserror::Error;

pub use load::LoadTable;
pub use motor::MotorTable;
pub use set_up::{Bench, Position};
pub use supply::SupplyTable;

/// The motor of the default bench.
pub const DEFAULT_MOTOR: &str = "antigravity-4006-kv380";

/// The load of the default bench.
pub const DEFAULT_LOAD: &str = "cfprop-13x4.4";

/// Why something cannot stand on the bench; one line.
#[derive(Debug, Error)]
pub enum BenchError {
    /// Neither a built-in name nor a file.
    #[error("{kind} {name}: not built in ({known}) and no such file")]
    Unknown {
        /// "bench", "motor" or "load".
        kind: &'static str,
        /// What was given.
        name: String,
        /// The built-in names.
        known: String,
    },
    /// A file that cannot be read or understood.
    #[error("{kind} file {path}: {reason}")]
    File {
        /// "bench", "motor", "load" or "bus".
        kind: &'static str,
        /// The file.
        path: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A quantity that no motor, load or supply has.
    #[error("{kind}: {key} = {value} is out of range; give {least} to {most} {unit}")]
    Range {
        /// "motor", "load" or "bus".
        kind: &'static str,
        /// The quantity.
        key: &'static str,
        /// Its value.
        value: f64,
        /// The least.
        least: f64,
        /// The greatest.
        most: f64,
        /// Its unit.
        unit: &'static str,
    },
    /// Too few or too many inductances.
    #[error("motor: give L, or L_d and L_q")]
    Inductances,
    /// A supply that is neither a voltage nor a pack.
    #[error(
        "bus {0}: give volts above 0 and up to 70, a pack from 1s to 14s, as 24 or 6s, or a file"
    )]
    Bus(String),
    /// A table of a supply that is none or two.
    #[error("bus: give volts or cells; sinks goes with volts, capacity_ah and charge with cells")]
    Source,
}

impl BenchError {
    /// The dotted key of a scenario that it is about.
    pub fn key(&self) -> String {
        match self {
            Self::Unknown { kind: "bench", .. } | Self::File { kind: "bench", .. } => {
                "bench.base".to_owned()
            }
            Self::Unknown { kind, .. } | Self::File { kind, .. } => format!("bench.{kind}"),
            Self::Range { kind, key, .. } => format!("bench.{kind}.{key}"),
            Self::Inductances => "bench.motor.L".to_owned(),
            Self::Bus(_) | Self::Source => "bench.bus".to_owned(),
        }
    }
}

/// A part of the bench: a name, a file's path, or the thing itself.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice<T> {
    /// A built-in name or a path.
    Named(String),
    /// Written out.
    Inline(T),
}

impl<T: DeserializeOwned + Clone> Choice<T> {
    fn find(&self, kind: &'static str) -> Result<T, BenchError> {
        let name = match self {
            Self::Inline(table) => return Ok(table.clone()),
            Self::Named(name) => name,
        };
        if let Some(found) = library::part(kind, name) {
            return Ok(found);
        }
        if !Path::new(name).is_file() {
            return Err(BenchError::Unknown {
                kind,
                name: name.clone(),
                known: library::known(kind),
            });
        }
        let failed = |reason: String| BenchError::File {
            kind,
            path: name.clone(),
            reason,
        };
        let text = std::fs::read_to_string(name).map_err(|error| failed(error.to_string()))?;
        toml::from_str(&text).map_err(|error| failed(toml_reason(&text, &error)))
    }
}

/// A TOML error in one line, with the line of the text that it is about.
pub fn toml_reason(text: &str, error: &toml::de::Error) -> String {
    let message = error.message().replace('\n', " ");
    match error.span() {
        Some(span) => format!("line {}: {message}", line_of_byte(text, span.start)),
        None => message,
    }
}

/// The line, from 1, of a byte of a text.
pub fn line_of_byte(text: &str, at: usize) -> usize {
    let before = &text.as_bytes()[..at.min(text.len())];
    before.iter().filter(|byte| **byte == b'\n').count() + 1
}

/// A quantity within its range, both ends included.
fn range(
    kind: &'static str,
    key: &'static str,
    value: f64,
    [least, most]: [f64; 2],
    unit: &'static str,
) -> Result<f64, BenchError> {
    if (least..=most).contains(&value) {
        return Ok(value);
    }
    Err(BenchError::Range {
        kind,
        key,
        value,
        least,
        most,
        unit,
    })
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

            // A number is the shortest text of it: volts.
            fn visit_f64<E>(self, number: f64) -> Result<Self::Value, E> {
                Ok(Choice::Named(number.to_string()))
            }

            fn visit_i64<E>(self, number: i64) -> Result<Self::Value, E> {
                Ok(Choice::Named(number.to_string()))
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
    use crate::plant::Extras;

    fn motor(text: &str) -> Result<Choice<MotorTable>, toml::de::Error> {
        #[derive(Deserialize)]
        struct Holder {
            motor: Choice<MotorTable>,
        }
        toml::from_str::<Holder>(text).map(|holder| holder.motor)
    }

    #[test]
    fn built_in_names_are_found_and_others_say_what_there_is() {
        let named = |name: &str| Choice::<MotorTable>::Named(name.to_owned());
        let (motor, extras) = named(DEFAULT_MOTOR).motor().unwrap();
        assert_eq!((motor.pole_pairs, motor.resistance_ohm), (12, 0.108));
        assert_eq!(extras, Extras::default());
        let error = named("nosuch").motor().unwrap_err().to_string();
        assert!(
            error.contains("nosuch") && error.contains("antigravity"),
            "{error}"
        );
        let load = |name: &str| Choice::<LoadTable>::Named(name.to_owned()).load();
        assert_eq!(load(DEFAULT_LOAD).unwrap().c2, 0.3e-6);
        assert_eq!(load("none").unwrap().inertia_kgm2, 8e-6);
    }

    #[test]
    fn tables_are_checked() {
        let round = motor("motor = { R = 0.1, L = 2e-5, flux = 1e-3, pole_pairs = 7 }").unwrap();
        let (round, extras) = round.motor().unwrap();
        assert_eq!((round.pole_pairs, round.inductance_h), (7, 2e-5));
        assert_eq!(extras, Extras::default());
        let rest = "flux = 1e-3, pole_pairs = 7";
        let salient = format!("motor = {{ R = 0.1, L_d = 2e-5, L_q = 3e-5, {rest} }}");
        let (salient, extras) = motor(&salient).unwrap().motor().unwrap();
        assert!((salient.inductance_h - 2.5e-5).abs() < 1e-18 && extras.saliency == 1.5);
        for (keys, word) in [
            ("R = -1.0, L = 2e-5", "R = -1"),
            ("R = 0.1", "L_d"),
            ("R = 0.1, L = 2e-5, L_q = 2e-5", "L_d"),
            ("R = 0.1, L = 2e-5, cogging_nm = 1e-3", "cogging_order = 0"),
            (
                "R = 0.1, L = 2e-5, harmonics = [{ order = 1, share = 0.1 }]",
                "order = 1",
            ),
            (
                "R = 0.1, L = 2e-5, winding = { k_per_w = 0.0, j_per_k = 1.0 }",
                "k_per_w = 0",
            ),
            (
                "R = 0.1, L = 2e-5, saturation_a = 0.5",
                "saturation_a = 0.5",
            ),
        ] {
            let choice = motor(&format!("motor = {{ {keys}, {rest} }}")).unwrap();
            let error = choice.motor().unwrap_err().to_string();
            assert!(error.contains(word), "{keys}: {error}");
        }
        let text = "\nmotor = { R = 0.1, K = 1 }";
        let error = motor(text).unwrap_err();
        let reason = toml_reason(text, &error);
        assert!(
            reason.contains("line 2") && reason.contains('K'),
            "{reason}"
        );
    }
}
