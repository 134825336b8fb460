//! The result of one run of a scenario.

use serde::Serialize;

use super::judge::Verdict;
use super::place::{self, Place};
use super::play::Played;
use crate::summary::Report;

/// The summary of a scenario with a single run.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// The figures.
    #[serde(flatten)]
    pub report: Report,
    /// The results of the expectations.
    pub expectations: Vec<Verdict>,
    /// Whether an interrupt ended the run early.
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

    /// Returns true if no expectation failed.
    pub fn held(&self) -> bool {
        !self.expectations.iter().any(Verdict::failed)
    }

    /// Returns the exit status of a program that played it: 0, 1 if an expectation failed, 130 if
    /// it was interrupted.
    pub fn exit_status(&self) -> u8 {
        exit_status(self.interrupted, self.held())
    }
}

/// Follows the conventions of shells.
pub(super) fn exit_status(interrupted: bool, held: bool) -> u8 {
    match (interrupted, held) {
        (true, _) => 130,
        (false, true) => 0,
        (false, false) => 1,
    }
}
