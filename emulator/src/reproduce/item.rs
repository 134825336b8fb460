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

/// The longest line of a table.
const LINE: usize = 110;

impl fmt::Display for Reproduction {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let width = self.items.iter().map(|item| item.name.len()).max();
        let width = width.unwrap_or_default();
        let show = |value: Option<f64>| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2}"))
        };
        let reasons = self.reasons();
        writeln!(
            f,
            "{:width$} {:>9} {:>9}      {:11} agrees from, to",
            "", "paper", "measured", ""
        )?;
        for rows in self.items.chunk_by(|a, b| a.note == b.note) {
            for item in rows {
                let reason = |of| reasons.iter().position(|reason| *reason == of);
                let verdict = match item.comparison.verdict {
                    Verdict::Agrees => "agrees".to_owned(),
                    Verdict::Differs => {
                        let number = reason(item.comparison.reason).unwrap_or_default() + 1;
                        format!("DIFFERS [{number}]")
                    }
                    Verdict::Open => "-".to_owned(),
                };
                let bound = item.comparison.bound;
                let bound = bound.map(|[low, high]| format!("{low:.2} {high:.2}"));
                let row = format!(
                    "{:width$} {:>9} {:>9} {:4} {verdict:11} {}",
                    item.name,
                    show(item.paper),
                    show(item.measured),
                    item.unit,
                    bound.unwrap_or_default(),
                );
                writeln!(f, "{}", row.trim_end())?;
            }
            write_wrapped(f, "", &rows[0].note)?;
        }
        for (index, reason) in reasons.iter().enumerate() {
            writeln!(f)?;
            write_wrapped(f, &format!("[{}]", index + 1), reason)?;
        }
        Ok(())
    }
}

impl Reproduction {
    /// Returns the reasons for the bounds of the items that miss them, each once.
    fn reasons(&self) -> Vec<&'static str> {
        let mut reasons = Vec::new();
        for Item { comparison, .. } in &self.items {
            if comparison.verdict == Verdict::Differs && !reasons.contains(&comparison.reason) {
                reasons.push(comparison.reason);
            }
        }
        reasons
    }
}

/// Writes a text on lines of bounded length, indented, with a mark before the first.
fn write_wrapped(f: &mut fmt::Formatter, mark: &str, text: &str) -> fmt::Result {
    let mut line = format!("{mark:4}");
    for word in text.split_whitespace() {
        if line.chars().count() + 1 + word.chars().count() > LINE {
            writeln!(f, "{}", line.trim_end())?;
            line = format!("{:4}", "");
        } else if line.chars().count() > 4 {
            line.push(' ');
        }
        line.push_str(word);
    }
    writeln!(f, "{}", line.trim_end())
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
        assert!(
            lines[1].contains("-1.12 pt   DIFFERS [1] 0.20 0.60"),
            "{text}"
        );
        assert!(lines[2].contains("0.19 pt   DIFFERS [1] "), "{text}");
        assert_eq!(lines[3], "    figure 7(c)", "once for both rows above");
        assert!(
            lines[4].contains("30.35 %    agrees      29.43 35.97"),
            "{text}"
        );
        assert!(lines[6].ends_with("0.29 deg  -"), "{text}");
        assert!(lines[9].starts_with("[1] an experiment"), "{text}");
        assert!(
            lines.iter().all(|line| line.chars().count() <= LINE),
            "{text}"
        );
    }
}
