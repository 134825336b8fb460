//! The papers' own figures, measured on the code that runs on the chip.

mod bosso;
mod colton;
mod item;
mod verdict;

pub use bosso::bosso;
pub use colton::colton;
pub use item::{Item, Reproduction};
pub use verdict::{Comparison, Verdict};
