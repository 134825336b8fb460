//! The interface of a recording format.

use std::io;

use crate::plant::Gate;
use crate::rig::{Period, Rig};
use crate::surroundings::Passage;

/// A format: it takes what it can represent.
pub(super) trait Sink {
    fn period(&mut self, _t_s: f64, _period: &Period, _rig: &Rig) -> io::Result<()> {
        Ok(())
    }

    fn passage(&mut self, _t_s: f64, _passage: &Passage) -> io::Result<()> {
        Ok(())
    }

    fn gates(&mut self, _time_ns: u64, _leg: usize, _gate: Gate) -> io::Result<()> {
        Ok(())
    }

    fn edge(&mut self, _time_ns: u64, _level: bool) -> io::Result<()> {
        Ok(())
    }

    fn frame(&mut self, _time_ns: u64, _frame: &[u8]) -> io::Result<()> {
        Ok(())
    }

    fn finish(self: Box<Self>) -> io::Result<()>;
}
