//! Runs the motor's identification, reports it and keeps the result.

use siskin_params::ParamId;
use siskin_throttle::access::Access;

use super::{Esc, check};
use crate::drive::{Setpoint, Snapshot};
use crate::identify::{Inputs, Outcome};
use crate::throttle::{LockThrottle, LockedAuthority};

/// Steps reported to the user, each with the progress at which it begins, percent.
const STEPS: [(u8, &str); 6] = [
    (0, "phase A"),
    (20, "phase B"),
    (40, "phase C"),
    (60, "spinning"),
    (80, "running up"),
    (90, "running down"),
];

impl Esc {
    /// Starts an identification requested by the stick, under the same conditions as a command; its result is
    /// kept.
    pub(super) fn identify_by_stick(&mut self, throttle: &mut impl LockThrottle, now_us: u64) {
        let drive = self.drive();
        let mut authority = LockedAuthority(throttle);
        if !authority.barred() && authority.may_test(now_us, drive) {
            self.identify(now_us, true);
        } else {
            self.warn_of("Not identified: fault, defect, settings lost");
            self.tells_us = now_us;
        }
    }

    /// Starts an identification; `keeps` has its result stored.
    pub(super) fn identify(&mut self, now_us: u64, keeps: bool) {
        self.keeps_result = keeps;
        let outcome = self.identify.begin(now_us);
        self.identified(outcome);
    }

    /// Ends the identification, if one is running.
    pub(super) fn end_identification(&mut self, reason: &'static str) {
        if let Some(outcome) = self.identify.end(reason) {
            self.identified(outcome);
        }
    }

    /// Returns the set-point that a running identification asks for.
    pub(super) fn identification(&self) -> Option<Setpoint> {
        self.identify.setpoint()
    }

    /// Applies the result and has it stored. Returns false, with a warning, if it makes no valid drive.
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

    /// Advances a running identification.
    pub(super) fn poll_identification(&mut self, now_us: u64, snapshot: &Snapshot) {
        if !self.identify.is_under_way() {
            // Not in the poll that ends it: both need stack.
            if core::mem::take(&mut self.keeps_result) && self.identify.report.settings().is_some()
            {
                self.keep_identified();
            }
            return;
        }
        let inputs = Inputs {
            now_us,
            snapshot,
            scale: &self.scale,
            limit_a: self.params.get(ParamId::LimPhaseA),
            rests: self.command.rests(),
        };
        if let Some(outcome) = self.identify.poll(&inputs) {
            self.identified(outcome);
        }
    }

    /// Clears MOT_IDENTIFY once what it requested is over or refused.
    pub(super) fn clear_identify_request(&mut self) {
        let id = ParamId::MotIdentify;
        if self.params.get(id) != 0.0 && !self.identify.is_under_way() {
            // 0 is in range.
            let _ = self.params.set(id, 0.0);
            self.component.report_value(id);
        }
    }

    fn identified(&mut self, mut outcome: Outcome) {
        if outcome == Outcome::Assume {
            self.motor_reassumed = true;
            let made = check(&self.running(), &self.board);
            let Err(error) = made else {
                return;
            };
            self.identify.end(error.reason);
            self.warn_in_pieces(error.param.entry().name, [": ", error.reason, ""]);
            outcome = Outcome::Done(Err(error.reason));
        }
        match outcome {
            Outcome::Progress(percent) => {
                self.component.report_progress(percent);
                if let Some((_, step)) = STEPS.iter().find(|(begun, _)| *begun == percent) {
                    self.component.report_step(step);
                }
            }
            Outcome::Assume => {}
            Outcome::Done(result) => {
                self.motor_reassumed = true;
                match result {
                    Ok(()) => self.component.report_step("done"),
                    Err(reason) => self.warn_in_pieces("Not identified: ", [reason, "", ""]),
                }
                self.component.identification_done(result.is_ok());
            }
        }
    }
}
