//! The fault matrix: every fault of the laboratory at every moment of a flight, with either drive, and the ESC's
//! reaction.
//!
//! The bench is the first paper's, with every switch edge and a winding that heats up; the ESC has that bench's
//! parameters. What is expected of a cell follows from the nature of the fault ([`Row`]).

mod bound;
mod cell;
mod drive;
mod moment;
#[cfg(feature = "plot")]
mod picture;
mod row;
mod table;

use rayon::prelude::*;
use serde::Serialize;

pub use bound::{Bounds, Miss};
pub use cell::Cell;
pub use drive::Drive;
pub use moment::Moment;
pub use row::{Reaction, Row};

use crate::device::StartError;

/// A cell, with what it violates of its expectations.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// The outcome of the fault.
    #[serde(flatten)]
    pub cell: Cell,
    /// The bounds it had to keep.
    pub bounds: Bounds,
    /// Those it violated.
    pub misses: Vec<Miss>,
}

/// All cells, drive by drive, fault by fault, moment by moment.
#[derive(Clone, Debug, Serialize)]
pub struct Matrix {
    /// The cells.
    pub cells: Vec<Judged>,
}

impl Matrix {
    /// Plays the selected cells on all processors.
    ///
    /// # Errors
    /// The bench does not fit its parameters.
    pub fn play(wanted: impl Fn(Row, Moment, Drive) -> bool) -> Result<Self, StartError> {
        let mut places = Vec::new();
        for drive in Drive::ALL {
            for row in Row::ALL {
                for moment in Moment::ALL {
                    if wanted(row, moment, drive) {
                        places.push((row, moment, drive));
                    }
                }
            }
        }
        let cells = places.into_par_iter().map(|(row, moment, drive)| {
            let cell = cell::play(row, moment, drive)?;
            let bounds = Bounds::of(&cell);
            Ok(Judged {
                misses: bounds.misses(&cell),
                bounds,
                cell,
            })
        });
        let cells = cells.collect::<Result<_, StartError>>()?;
        Ok(Self { cells })
    }

    /// Returns the cells that violate something.
    pub fn failed(&self) -> impl Iterator<Item = &Judged> {
        self.cells.iter().filter(|judged| !judged.misses.is_empty())
    }
}
