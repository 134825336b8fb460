//! What is wrong with a bench.

use thiserror::Error;

/// Why something cannot be put on the bench; one line.
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
    /// A supply table that gives none of the sources, or both.
    #[error("bus: give volts or cells; sinks goes with volts, capacity_ah and charge with cells")]
    Source,
}

impl BenchError {
    /// Returns the dotted key of the scenario that it is about.
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

/// Checks that a quantity is in range, both ends included.
pub(super) fn range(
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
