//! The fault matrix: every fault of the laboratory at every moment of a flight, with either drive, and what the ESC
//! makes of it.
//!
//! The bench is the first paper's with every switch edge and a winding that warms up; the ESC has the parameters of
//! that bench. What is expected of a cell follows from what the fault is ([`Row`]).

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

/// A cell with what it misses of what is expected.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// What came of the fault.
    #[serde(flatten)]
    pub cell: Cell,
    /// What it was to keep within.
    pub bounds: Bounds,
    /// What it did not.
    pub misses: Vec<Miss>,
}

/// All cells, drive by drive, fault by fault, moment by moment.
#[derive(Clone, Debug, Serialize)]
pub struct Matrix {
    /// The cells.
    pub cells: Vec<Judged>,
}

impl Matrix {
    /// Plays those cells that are wanted, on all processors.
    ///
    /// # Errors
    /// A bench that does not fit its parameters.
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

    /// Cells that miss something.
    pub fn failed(&self) -> impl Iterator<Item = &Judged> {
        self.cells.iter().filter(|judged| !judged.misses.is_empty())
    }
}
