//! Runs the self-test and reports it.

use super::Esc;
use crate::check::{Inputs, Outcome, Probe};
use crate::drive::Snapshot;
use crate::mavlink::Warning;

impl Esc {
    /// Advances a running self-test with the board's measurements. Call it after each [`Esc::poll`].
    pub fn test_itself(&mut self, snapshot: &Snapshot, probe: &mut impl Probe) {
        let inputs = Inputs {
            snapshot,
            scale: &self.scale,
            temperature_c: self.telemetry.temperature_c,
            rests: self.command.rests(),
        };
        let with = (&self.board, &self.params);
        match self.check.poll(&inputs, with, probe) {
            None => {}
            Some(Outcome::Progress(percent)) => self.component.report_progress(percent),
            Some(Outcome::Done { passed }) => {
                if let Some(text) = self.misfits() {
                    self.warn(text);
                }
                self.tells_us = 0;
                self.component.check_done(passed && self.unfit.is_none());
            }
        }
    }

    /// Returns the items that are out of bounds, as many as the text holds; the file lists all.
    fn misfits(&self) -> Option<Warning> {
        let mut text = Warning::new();
        self.check.report.for_each_line(&self.params, |line| {
            if line.ok() {
                return;
            }
            let begun = if text.is_empty() { "Self-test: " } else { ", " };
            for piece in [begun, line.name[0], line.name[1]] {
                let _ = text.push_str(piece);
            }
        });
        (!text.is_empty()).then_some(text)
    }
}
