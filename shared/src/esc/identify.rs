//! The identification of the motor as the ESC runs, reports and keeps it.

use super::{Esc, check};
use crate::drive::{Setpoint, Snapshot};
use crate::identify::{Outcome, Sight};
use crate::mavlink::Warning;
use crate::params::ParamId;

impl Esc {
    /// Begins an identification.
    pub(super) fn identify(&mut self, now_us: u64) {
        let outcome = self.identify.begin(now_us);
        self.identified(outcome);
    }

    /// Ends it, if there is one.
    pub(super) fn end_identification(&mut self, reason: &'static str) {
        if let Some(outcome) = self.identify.end(reason) {
            self.identified(outcome);
        }
    }

    /// What it asks of the drive, while one is under way.
    pub(super) fn identification(&self) -> Option<Setpoint> {
        self.identify.setpoint()
    }

    /// Takes over what has been found, and has it stored. False, with a text, where it makes no drive.
    pub(super) fn keep_identified(&mut self) -> bool {
        let settings = self.identify.report.settings();
        let kept = match settings.map(|settings| self.change(&settings)) {
            Some(Ok(())) => {
                self.storage.save();
                return true;
            }
            Some(Err(error)) => [error.param.entry().name, ": ", error.reason],
            None => ["nothing is identified", "", ""],
        };
        self.warn_in_pieces("Not kept: ", kept);
        false
    }

    /// Goes on with an identification.
    pub(super) fn look_at_motor(&mut self, now_us: u64, snapshot: &Snapshot) {
        if !self.identify.is_under_way() {
            return;
        }
        let sight = Sight {
            now_us,
            snapshot,
            scale: &self.scale,
            limit_a: self.params.get(ParamId::LimPhaseA),
            rests: self.command.rests(),
        };
        if let Some(outcome) = self.identify.look(&sight) {
            self.identified(outcome);
        }
    }

    fn identified(&mut self, mut outcome: Outcome) {
        if outcome == Outcome::Assume {
            self.reassumes = true;
            let made = check(&self.running(), &self.board);
            let Err(error) = made else {
                return;
            };
            self.identify.end(error.reason);
            outcome = Outcome::Done(Err(error.reason));
        }
        match outcome {
            Outcome::Progress(percent) => self.component.tell_progress(percent),
            Outcome::Assume => {}
            Outcome::Done(result) => {
                self.reassumes = true;
                if let Err(reason) = result {
                    self.warn_in_pieces("Not identified: ", [reason, "", ""]);
                }
                self.component.check_done(result.is_ok());
            }
        }
    }

    fn warn_in_pieces(&mut self, what: &str, why: [&str; 3]) {
        let mut text = Warning::new();
        // Whatever is longer than a text on MAVLink would be cut there as well.
        let _ = text.push_str(what);
        for piece in why {
            let _ = text.push_str(piece);
        }
        self.warn(text);
    }
}
