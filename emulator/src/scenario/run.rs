//! One of several runs, played or refused.

use super::error::ScenarioError;
use super::place::Place;
use super::play::Played;
use super::table::Row;
use crate::watch::WatchError;

/// One of several runs, with what came of it.
pub struct Run {
    pub(super) place: Place,
    pub(super) result: Result<Played, ScenarioError>,
}

impl Run {
    /// Takes the result of a run; one that the ESC or the plant refuses is a result too, and ends no other run.
    ///
    /// # Errors
    /// What has nothing to do with this run: it cannot be recorded.
    pub(super) fn of(
        place: Place,
        result: Result<Played, ScenarioError>,
    ) -> Result<Self, ScenarioError> {
        match result {
            Err(error @ ScenarioError::Watch(WatchError::Record(_))) => Err(place.blame(error)),
            result => Ok(Self { place, result }),
        }
    }

    /// Returns true if it was stopped before its end.
    pub(super) fn was_interrupted(&self) -> bool {
        matches!(&self.result, Ok(played) if played.interrupted)
    }

    /// Returns it as a table's row.
    pub fn row(&self) -> Row {
        match &self.result {
            Ok(played) => Row::of(&self.place, &played.report, &played.verdicts),
            Err(error) => Row::refused(&self.place, &error.to_string()),
        }
    }
}

/// Passes runs on, unless each of them was refused: then something is wrong with all.
///
/// # Errors
/// The first run's.
pub(super) fn any_played(mut runs: Vec<Run>) -> Result<Vec<Run>, ScenarioError> {
    if runs.is_empty() || runs.iter().any(|run| run.result.is_ok()) {
        return Ok(runs);
    }
    let Run { place, result } = runs.swap_remove(0);
    match result {
        Ok(_) => Ok(runs),
        Err(error) => Err(place.blame(error)),
    }
}
