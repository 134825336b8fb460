//! Judges whether the figures of a run are what the scenario expects.

use serde::Serialize;
use serde_json::Value;

use super::error::ScenarioError;
use super::file::{Expectation, RUN};
use crate::summary::{Figures, Report};

/// The result of an expectation.
#[derive(Clone, Debug, Serialize)]
pub struct Verdict {
    /// The window's name.
    pub window: String,
    /// The figure's key.
    pub key: String,
    /// The figure; true counts as 1, a list as its length.
    pub value: Option<f64>,
    /// What it must be.
    pub wanted: String,
    /// Whether it is; `None` for a figure of the control if that is not visible, as on a machine that is driven only
    /// over its wire.
    pub held: Option<bool>,
    /// Margin to failure; −∞ without a figure, ∞ for one that is not visible.
    #[serde(skip)]
    pub(super) slack: f64,
}

impl Verdict {
    /// Returns true if the figure is not what it must be.
    pub fn failed(&self) -> bool {
        self.held == Some(false)
    }

    /// Says what was found and what was wanted.
    pub fn sentence(&self) -> String {
        let value = self
            .value
            .map_or_else(|| "no data".to_owned(), |value| value.to_string());
        let (window, key, wanted) = (&self.window, &self.key, &self.wanted);
        format!("{window}.{key} is {value}, wanted {wanted}")
    }
}

/// Compares a figure with its expectation.
pub(super) fn judge(expected: &Expectation, report: &Report) -> Result<Verdict, ScenarioError> {
    let wrong = |problem| ScenarioError::Expectation {
        window: expected.window.clone(),
        key: expected.key.clone(),
        problem,
    };
    let of_faults = expected.window == RUN && expected.key == "faults";
    let seen = report.faults.is_some()
        || !of_faults && !Figures::OF_CONTROL.contains(&expected.key.as_str());
    let value = if of_faults {
        report.faults.as_ref().map(|faults| faults.len() as f64)
    } else {
        let window = report.windows.iter().find(|w| w.name == expected.window);
        let figures = window.ok_or_else(|| wrong("names no window"))?;
        let figures = serde_json::to_value(figures).map_err(|_| wrong("cannot be read"))?;
        match figures.get(&expected.key) {
            Some(Value::Bool(flag)) => Some(f64::from(u8::from(*flag))),
            Some(Value::String(_)) | None => return Err(wrong("names no figure")),
            Some(number) => number.as_f64(),
        }
    };
    let x = value.unwrap_or(f64::NAN);
    let mut wanted = Vec::new();
    let mut held = value.is_some();
    let mut slack = f64::INFINITY;
    if let Some(limit) = expected.below {
        wanted.push(format!("below {limit}"));
        held &= x < limit;
        slack = slack.min(limit - x);
    }
    if let Some(limit) = expected.above {
        wanted.push(format!("above {limit}"));
        held &= x > limit;
        slack = slack.min(x - limit);
    }
    match (expected.equals, expected.within) {
        (Some(target), within) => {
            let within = within.unwrap_or(0.0);
            wanted.push(format!("{target} ± {within}"));
            held &= (x - target).abs() <= within;
            slack = slack.min(within - (x - target).abs());
        }
        (None, None) => {}
        (None, Some(_)) => return Err(wrong("has within and no equals")),
    }
    if wanted.is_empty() {
        return Err(wrong("says neither below, above nor equals"));
    }
    Ok(Verdict {
        window: expected.window.clone(),
        key: expected.key.clone(),
        value,
        wanted: wanted.join(" and "),
        held: seen.then_some(held),
        slack: match value {
            Some(_) => slack,
            None if seen => f64::NEG_INFINITY,
            None => f64::INFINITY,
        },
    })
}
