//! A part of the bench as chosen: by name, by path, or inline.

use std::fmt;
use std::path::Path;

use serde::de::value::MapAccessDeserializer;
use serde::de::{DeserializeOwned, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::error::BenchError;
use super::library;
use super::text::toml_reason;

/// A part of the bench: a name, a file's path, or the thing itself.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice<T> {
    /// A built-in name or a path.
    Named(String),
    /// Written out.
    Inline(T),
}

impl<T: DeserializeOwned + Clone> Choice<T> {
    pub(super) fn find(&self, kind: &'static str) -> Result<T, BenchError> {
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

            // A number stands for its shortest text: volts.
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
