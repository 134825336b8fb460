//! The matrix as a readable table.

use std::fmt;

use super::row::Reaction;
use super::{Cell, Judged, Matrix, Miss};

impl Reaction {
    /// Returns a word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::GoesOn => "goes on",
            Self::Recovers => "recovers",
            Self::Rests => "rests",
            Self::Stops => "stops",
            Self::Fails => "FAILS",
        }
    }
}

impl Miss {
    /// Returns a word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Current => "current",
            Self::Supply => "supply",
            Self::Winding => "winding",
            Self::Stage => "stage",
            Self::Cause => "cause",
            Self::Reaction => "reaction",
            Self::Time => "time",
            Self::Gates => "gates",
            Self::Again => "again",
        }
    }
}

impl Cell {
    /// Returns what was named, or else the limits that bound.
    pub(super) fn words(&self) -> String {
        let named: Vec<&str> = self.named.iter().map(String::as_str).collect();
        let limits: Vec<&str> = self.limits.iter().copied().collect();
        match (named.is_empty(), limits.is_empty()) {
            (true, true) => "-".to_owned(),
            (true, false) => format!("({})", limits.join(", ")),
            (false, _) => named.join(", "),
        }
    }
}

impl fmt::Display for Matrix {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(
            f,
            "{:14} {:22} {:10} {:8} {:>8} {:>7} {:>7} {:>6} {:>6} {:>6} {:>5} {:>5}  named (limits); MISSED",
            "drive",
            "fault",
            "moment",
            "reaction",
            "after ms",
            "within",
            "trip µs",
            "A",
            "below",
            "V",
            "wind.",
            "stage"
        )?;
        for Judged {
            cell,
            bounds,
            misses,
        } in &self.cells
        {
            let time = |time: Option<f64>, places: usize| {
                time.map_or_else(|| "-".to_owned(), |time| format!("{time:.places$}"))
            };
            let (after, within) = (time(cell.after_ms, 2), time(bounds.within_ms, 1));
            let trip = time(cell.trip_us, 2);
            write!(
                f,
                "{:14} {:22} {:10} {:8} {after:>8} {within:>7} {trip:>7} {:>6.1} {:>6.1} {:>6.2} {:>5.1} {:>5.1}  {}",
                cell.drive.name(),
                cell.fault.name(),
                cell.moment.name(),
                cell.reaction.name(),
                cell.current_a,
                bounds.current_a,
                cell.bus_v,
                cell.winding_c,
                cell.stage_c,
                cell.words()
            )?;
            if !misses.is_empty() {
                let names: Vec<&str> = misses.iter().map(|miss| miss.name()).collect();
                write!(f, "; MISSED: {}", names.join(", "))?;
            }
            writeln!(f)?;
        }
        let failed = self.failed().count();
        writeln!(
            f,
            "{} cells, {failed} of them miss something",
            self.cells.len()
        )
    }
}
