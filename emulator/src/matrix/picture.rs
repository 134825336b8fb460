//! The matrix as a picture.

use plotters::style::RGBColor;

use super::bound::Miss;
use super::drive::Drive;
use super::moment::Moment;
use super::row::{Reaction, Row};
use super::{Judged, Matrix};
use crate::plot::grid::{Grid, Place};

// Light enough for text on them, and distinguishable by the colour-blind.
const GOES_ON: RGBColor = RGBColor(0xd5, 0xec, 0xe4);
const RECOVERS: RGBColor = RGBColor(0xd9, 0xea, 0xf7);
const RESTS: RGBColor = RGBColor(0xf0, 0xf0, 0xf0);
const STOPS: RGBColor = RGBColor(0xfb, 0xe6, 0xc4);
const FAILS: RGBColor = RGBColor(0xf3, 0xc4, 0xa5);

impl Reaction {
    fn tint(self) -> RGBColor {
        match self {
            Self::GoesOn => GOES_ON,
            Self::Recovers => RECOVERS,
            Self::Rests => RESTS,
            Self::Stops => STOPS,
            Self::Fails => FAILS,
        }
    }
}

impl Matrix {
    /// Faults by moments, drive beside drive; cells not played are left out.
    pub fn grid(&self) -> Grid {
        let columns = || Moment::ALL.map(|moment| moment.name().to_owned()).to_vec();
        let rows = Row::ALL.map(|row| {
            let cells = self.cells.iter().filter(|judged| judged.cell.fault == row);
            (row.name().to_owned(), cells.map(place).collect())
        });
        let key = [
            (GOES_ON, "goes on"),
            (RECOVERS, "turns again by itself"),
            (RESTS, "at rest, as asked"),
            (STOPS, "off until zero throttle, and said why"),
            (FAILS, "still tries at the end, or is off without a word"),
        ];
        Grid {
            title: "What the ESC makes of each fault: time to its answer, greatest phase current and supply; \
                    framed: what is missed"
                .to_owned(),
            groups: Drive::ALL.map(|drive| (drive.name().to_owned(), columns())).to_vec(),
            rows: rows.to_vec(),
            key: key.map(|(tint, meaning)| (tint, meaning.to_owned())).to_vec(),
        }
    }
}

fn place(judged: &Judged) -> Place {
    let Judged { cell, misses, .. } = judged;
    let mut lines = vec![match (cell.trip_us, cell.after_ms) {
        (Some(us), _) => format!("{us:.2} µs"),
        (_, Some(ms)) if ms < 10.0 => format!("{ms:.2} ms"),
        (_, Some(ms)) => format!("{ms:.0} ms"),
        _ => "-".to_owned(),
    }];
    lines.push(format!("{:.1} A  {:.1} V", cell.current_a, cell.bus_v));
    let missed: Vec<&str> = misses.iter().map(|miss| Miss::name(*miss)).collect();
    if !missed.is_empty() {
        lines.push(missed.join(", "));
    }
    Place {
        tint: cell.reaction.tint(),
        lines,
        warns: !missed.is_empty(),
    }
}
