//! The drives of the matrix.

use serde::Serialize;

/// How the motor is driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Drive {
    /// `CTL_DRIVE` 0.
    FieldOriented,
    /// `CTL_DRIVE` 1, at 40 kHz.
    SixStep,
}

impl Drive {
    /// Both.
    pub const ALL: [Self; 2] = [Self::FieldOriented, Self::SixStep];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::FieldOriented => "field-oriented",
            Self::SixStep => "six-step",
        }
    }
}
