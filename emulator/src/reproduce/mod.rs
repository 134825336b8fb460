//! The papers' own figures, measured on the code that runs on the chip.

mod bosso;
mod colton;

pub use bosso::bosso;
pub use colton::colton;

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
}

/// What the paper says or its formula gives, beside what was measured; what is not finite was not.
fn item(
    name: impl Into<String>,
    paper: Option<f64>,
    measured: impl Into<Option<f64>>,
    unit: &'static str,
    note: impl Into<String>,
) -> Item {
    Item {
        name: name.into(),
        paper,
        measured: measured.into().filter(|value| value.is_finite()),
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
        writeln!(f, "{:width$} {:>9} {:>9}", "", "paper", "measured")?;
        for item in &self.items {
            writeln!(
                f,
                "{:width$} {:>9} {:>9} {:4} {}",
                item.name,
                show(item.paper),
                show(item.measured),
                item.unit,
                item.note
            )?;
        }
        Ok(())
    }
}
