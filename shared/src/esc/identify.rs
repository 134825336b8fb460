//! The identification of the motor as the ESC runs, reports and keeps it.

use super::{Esc, check};
use crate::drive::{Setpoint, Snapshot};
use crate::identify::{Outcome, Sight};
use crate::input::access::Access;
use crate::mavlink::Warning;
use crate::params::ParamId;
use crate::throttle::{Reach, Reached};

/// What a person is told of, each with the progress at which it begins, percent.
const STEPS: [(u8, &str); 6] = [
    (0, "phase A"),
    (20, "phase B"),
    (40, "phase C"),
    (60, "spinning"),
    (80, "running up"),
    (90, "running down"),
];

impl Esc {
    /// Begins one that the stick asks for, if a command could; what it finds is kept. If settings were lost it could
    /// not be: the defaults would be stored with it.
    pub(super) fn identify_by_stick(&mut self, throttle: &mut impl Reach, now_us: u64) {
        let drive = self.drive();
        if !self.storage.is_lost() && Reached(throttle).may_test(now_us, drive) {
            self.identify(now_us, true);
        } else {
            self.warn_of("Not identified: a fault, or settings lost");
        }
    }

    /// Begins an identification, of which what it finds is kept or not.
    pub(super) fn identify(&mut self, now_us: u64, keeps: bool) {
        self.keeps = keeps;
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
            // At another look than that of the end: both need stack.
            if core::mem::take(&mut self.keeps) && self.identify.report.settings().is_some() {
                self.keep_identified();
            }
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

    /// What MOT_IDENTIFY has asked for is over, or was refused.
    pub(super) fn end_order(&mut self) {
        let id = ParamId::MotIdentify;
        if self.params.get(id) != 0.0 && !self.identify.is_under_way() {
            // In its range.
            let _ = self.params.set(id, 0.0);
            self.component.tell_value(id);
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
            Outcome::Progress(percent) => {
                self.component.tell_progress(percent);
                if let Some((_, step)) = STEPS.iter().find(|(begun, _)| *begun == percent) {
                    self.component.tell_step(step);
                }
            }
            Outcome::Assume => {}
            Outcome::Done(result) => {
                self.reassumes = true;
                match result {
                    Ok(()) => self.component.tell_step("done"),
                    Err(reason) => self.warn_in_pieces("Not identified: ", [reason, "", ""]),
                }
                self.component.check_done(result.is_ok());
            }
        }
    }

    fn warn_in_pieces(&mut self, what: &str, why: [&str; 3]) {
        let mut text = Warning::new();
        let _ = text.push_str(what);
        for piece in why {
            // What is longer than a text on MAVLink is cut: it would be left out as a whole.
            let room = text.capacity() - text.len();
            let _ = text.push_str(piece.get(..room).unwrap_or(piece));
        }
        self.warn(text);
    }
}
