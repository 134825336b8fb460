//! The self-test as the ESC runs and reports it.

use super::Esc;
use crate::check::{Outcome, Probe, Sight};
use crate::drive::Snapshot;
use crate::mavlink::Warning;

impl Esc {
    /// Goes on with a self-test, if there is one, by what the board measures; to be called after each
    /// [`Esc::poll`].
    pub fn test_itself(&mut self, snapshot: &Snapshot, probe: &mut impl Probe) {
        let sight = Sight {
            snapshot,
            scale: &self.scale,
            temperature_c: self.telemetry.temperature_c,
            rests: self.command.rests(),
        };
        let with = (&self.board, &self.params);
        match self.check.look(&sight, with, probe) {
            None => {}
            Some(Outcome::Progress(percent)) => self.component.tell_progress(percent),
            Some(Outcome::Done { passed }) => {
                if let Some(text) = self.misfits() {
                    self.warn(text);
                }
                self.component.check_done(passed);
            }
        }
    }

    /// The items that are out of their bounds, as far as a text holds them: all are in the file.
    fn misfits(&self) -> Option<Warning> {
        let mut text = Warning::new();
        self.check.report.tell(&self.params, |line| {
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
