//! What one run of a scenario comes to for who asked for it.

use serde::Serialize;

use super::judge::Verdict;
use super::place::{self, Place};
use super::play::Played;
use crate::summary::Report;

/// The summary of a scenario that is one run.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// The figures.
    #[serde(flatten)]
    pub report: Report,
    /// What was expected of them.
    pub expectations: Vec<Verdict>,
    /// Whether an interrupt has ended the run before its time.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub interrupted: bool,
    /// What the seed drew, if anything.
    #[serde(serialize_with = "place::map", skip_serializing_if = "Vec::is_empty")]
    pub drawn: Vec<(String, toml::Value)>,
    /// Which run it is.
    #[serde(skip)]
    pub place: Place,
}

impl Outcome {
    pub(super) fn new(played: Played, place: Place) -> Self {
        let Played {
            report,
            verdicts,
            interrupted,
        } = played;
        Self {
            report,
            expectations: verdicts,
            interrupted,
            drawn: place.drawn.clone(),
            place,
        }
    }

    /// Whether no expectation failed.
    pub fn held(&self) -> bool {
        !self.expectations.iter().any(Verdict::failed)
    }

    /// What a program that played it ends with: 0, 1 where an expectation failed, 130 where it was
    /// interrupted.
    pub fn exit_status(&self) -> u8 {
        exit_status(self.interrupted, self.held())
    }
}

/// As shells have it.
pub(super) fn exit_status(interrupted: bool, held: bool) -> u8 {
    match (interrupted, held) {
        (true, _) => 130,
        (false, true) => 0,
        (false, false) => 1,
    }
}
