//! A paper's figures, each with what was measured, and how they are printed.

use std::fmt;

use serde::Serialize;

use super::verdict::{Comparison, Verdict};
use crate::plot::chart::Figure;

/// A paper's figures and those measured here.
#[derive(Clone, Debug, Serialize)]
pub struct Reproduction {
    /// In the paper's order.
    pub items: Vec<Item>,
    /// The paper's pictures, drawn from the same measurements.
    #[serde(skip)]
    pub figures: Vec<Figure>,
}

/// One figure.
#[derive(Clone, Debug, Serialize)]
pub struct Item {
    /// Its name.
    pub name: String,
    /// The paper's value, or that of its formula.
    pub paper: Option<f64>,
    /// What was measured.
    pub measured: Option<f64>,
    /// Unit of both.
    pub unit: &'static str,
    /// What they are, in a line.
    pub note: String,
    /// Whether they agree, within which bound and why.
    #[serde(flatten)]
    pub comparison: Comparison,
}

/// Creates an item from the paper's value, or its formula's, and the measurement; a non-finite
/// value counts as not measured.
pub(super) fn item(
    name: impl Into<String>,
    paper: Option<f64>,
    measured: impl Into<Option<f64>>,
    unit: &'static str,
    note: impl Into<String>,
) -> Item {
    let name = name.into();
    let measured = measured.into().filter(|value| value.is_finite());
    Item {
        comparison: Comparison::of(&name, paper, measured),
        name,
        paper,
        measured,
        unit,
        note: note.into(),
    }
}

impl fmt::Display for Reproduction {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let width = self.items.iter().map(|item| item.name.len()).max();
        let width = width.unwrap_or_default();
        let show = |value: Option<f64>| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2}"))
        };
        writeln!(
            f,
            "{:width$} {:>9} {:>9}      {:7} {:20}",
            "", "paper", "measured", "", "agrees from, to"
        )?;
        for item in &self.items {
            let verdict = match item.comparison.verdict {
                Verdict::Agrees => "agrees",
                Verdict::Differs => "DIFFERS",
                Verdict::Open => "-",
            };
            let bound = item.comparison.bound;
            let bound = bound.map(|[low, high]| format!("{low:.2} {high:.2}"));
            writeln!(
                f,
                "{:width$} {:>9} {:>9} {:4} {verdict:7} {:20} {}",
                item.name,
                show(item.paper),
                show(item.measured),
                item.unit,
                bound.unwrap_or_default(),
                item.note
            )?;
        }
        self.differences(f)
    }
}

impl Reproduction {
    /// Prints the reason for the bound of each item that misses it: items of one kind share a
    /// reason.
    fn differences(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let differs = |item: &&Item| item.comparison.verdict == Verdict::Differs;
        let differing: Vec<&Item> = self.items.iter().filter(differs).collect();
        let of_reason = |a: &&Item, b: &&Item| a.comparison.reason == b.comparison.reason;
        for kind in differing.chunk_by(of_reason) {
            let names: Vec<_> = kind.iter().map(|item| item.name.as_str()).collect();
            let reasons = kind.first().map(|item| item.comparison.reason);
            let reason = reasons.unwrap_or_default();
            writeln!(f, "\ndiffering: {}: {reason}", names.join(", "))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_stands_out_with_its_reason() {
        let reproduction = Reproduction {
            items: vec![
                item(
                    "fig7_efficiency_diff_3000",
                    Some(0.4),
                    -1.12,
                    "pt",
                    "figure 7(c)",
                ),
                item(
                    "fig7_efficiency_diff_4500",
                    Some(0.77),
                    0.19,
                    "pt",
                    "figure 7(c)",
                ),
                item("ripple_foc_4500", Some(32.7), 30.35, "%", "figure 4(d)"),
                item("angle_error_3000", None, 0.29, "deg", "no figure"),
            ],
            figures: Vec::new(),
        };
        let text = reproduction.to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[1].contains("-1.12 pt   DIFFERS 0.20 0.60"), "{text}");
        assert!(
            lines[3].contains("30.35 %    agrees  29.43 35.97"),
            "{text}"
        );
        assert!(lines[4].contains("0.29 deg  -  "), "{text}");
        let [reason] = lines[6..] else {
            panic!("{text}")
        };
        let names =
            "differing: fig7_efficiency_diff_3000, fig7_efficiency_diff_4500: an experiment";
        assert!(reason.starts_with(names), "{text}");
    }
}
