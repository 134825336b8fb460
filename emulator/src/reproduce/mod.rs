//! The papers' own figures, measured on the code that runs on the chip.

mod bosso;
mod colton;
mod verdict;

pub use bosso::bosso;
pub use colton::colton;
pub use verdict::{Comparison, Verdict};

use std::fmt;

use serde::Serialize;

use crate::plot::chart::Figure;

/// A paper's figures beside those measured here.
#[derive(Clone, Debug, Serialize)]
pub struct Reproduction {
    /// In the order of the paper.
    pub items: Vec<Item>,
    /// The paper's pictures, drawn from the same measurements.
    #[serde(skip)]
    pub figures: Vec<Figure>,
}

/// One figure.
#[derive(Clone, Debug, Serialize)]
pub struct Item {
    /// What it is called.
    pub name: String,
    /// What the paper says or its formula gives.
    pub paper: Option<f64>,
    /// What was measured.
    pub measured: Option<f64>,
    /// Unit of both.
    pub unit: &'static str,
    /// What they are, in a line.
    pub note: String,
    /// Whether that is the same, within which bound and why.
    #[serde(flatten)]
    pub comparison: Comparison,
}

/// What the paper says or its formula gives, beside what was measured; what is not finite was not.
fn item(
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
            "{:width$} {:>9} {:>9}      verdict",
            "", "paper", "measured"
        )?;
        for item in &self.items {
            writeln!(
                f,
                "{:width$} {:>9} {:>9} {:4} {:7} {}",
                item.name,
                show(item.paper),
                show(item.measured),
                item.unit,
                match item.comparison.verdict {
                    Verdict::Agrees => "agrees",
                    Verdict::Differs => "DIFFERS",
                    Verdict::Open => "-",
                },
                item.note
            )?;
        }
        for item in &self.items {
            let Comparison {
                verdict,
                bound,
                reason,
            } = item.comparison;
            if let (Verdict::Differs, Some([low, high])) = (verdict, bound) {
                let (name, unit) = (&item.name, item.unit);
                writeln!(
                    f,
                    "{name} differs: not within {low:.2} to {high:.2} {unit}: {reason}"
                )?;
            }
        }
        Ok(())
    }
}
