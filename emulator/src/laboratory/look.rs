//! Observes the ESCs of a laboratory.

use std::mem;

use crate::machine::Onlooker;
use crate::record::Row;
use crate::rig::{Period, Rig};
use crate::summary::Summary;
use crate::watch::Void;

/// What is kept of each ESC's periods.
pub(super) struct Look {
    esc: usize,
    /// Why it cannot go on: the first reason.
    failed: Option<Void>,
    /// Packed rows of each ESC, if wanted.
    rows: Option<Vec<Vec<u8>>>,
    /// A summary of each ESC without windows, if its hash is wanted.
    summaries: Option<Vec<Summary>>,
}

impl Look {
    pub(super) fn new(escs: usize, records: bool, traces: bool) -> Self {
        Self {
            esc: 0,
            failed: None,
            rows: records.then(|| vec![Vec::new(); escs]),
            summaries: traces.then(|| (0..escs).map(|_| Summary::new([])).collect()),
        }
    }

    /// Returns why the laboratory cannot go on, if it cannot.
    pub(super) fn failed(&self) -> Option<Void> {
        self.failed
    }

    /// Returns the rows of an ESC since the last call.
    pub(super) fn take_recorded(&mut self, esc: usize) -> Option<Vec<u8>> {
        Some(mem::take(&mut self.rows.as_mut()?[esc]))
    }

    /// Returns the hash of an ESC so far.
    pub(super) fn trace_hash(&self, esc: usize) -> Option<String> {
        let summary = &self.summaries.as_ref()?[esc];
        Some(summary.report(0.0, 0.0).trace_hash)
    }
}

impl Onlooker for Look {
    fn esc(&mut self, esc: usize) {
        self.esc = esc;
    }

    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        self.failed = self.failed.or_else(|| Void::of(t_s, period, rig));
        if let Some(rows) = &mut self.rows {
            Row::of(t_s, period, rig).pack(&mut rows[self.esc]);
        }
        if let Some(summaries) = &mut self.summaries {
            summaries[self.esc].add(t_s, period, rig);
        }
    }
}
