//! PREFLIGHT_CALIBRATION: of all it covers, an ESC has the throttle end points, taught by stick. It
//! takes as long as the user does, so it is acknowledged step by step.

use mavlink::dialects::ardupilotmega::MavResult;
use siskin_throttle::calibration::Step;
use siskin_throttle::signal::Signal;

use super::{
    ACCEPTED, Act, CANCELLED, Command, Commands, Context, DENIED, DriveStatus, FAILED, IN_PROGRESS,
    PREFLIGHT_CALIBRATION, Replies, TEMPORARILY_REJECTED,
};

/// Parameter 7: the ESC.
const ESC: f32 = 1.0;

impl Commands {
    /// Begins a calibration; all zeros end the one under way.
    pub(super) fn calibrate(
        &mut self,
        command: &Command,
        drive: DriveStatus,
        context: &Context,
        replies: &mut Replies,
    ) -> MavResult {
        let [others @ .., esc] = command.params;
        let others = others.iter().any(|param| *param != 0.0);
        if !others && esc == 0.0 {
            if self.calibrates().is_some() {
                self.act = Some(Act::EndCalibration);
                self.end_calibration(CANCELLED, replies);
            }
            return ACCEPTED;
        }
        // DShot's throttle has no ends to teach.
        let digital = matches!(context.telemetry.signal, Some(Signal::Dshot { .. }));
        if others || esc != ESC || digital {
            return DENIED;
        }
        if self.is_busy() || !drive.stopped {
            return TEMPORARILY_REJECTED;
        }
        self.under_way = Some(*command);
        self.act = Some(Act::Calibrate);
        IN_PROGRESS
    }

    /// Reports the stick's next step. The end points are stored before the end is reported.
    pub(in super::super) fn follow_stick(&mut self, step: Step, replies: &mut Replies) {
        match (step, self.calibrates()) {
            (Step::Full, Some(command)) => replies.ack(command.from, command.number, IN_PROGRESS),
            (Step::Cancelled, _) => self.end_calibration(FAILED, replies),
            _ => {}
        }
    }

    /// Ends the calibration under way, if any, with this result.
    pub(in super::super) fn end_calibration(&mut self, result: MavResult, replies: &mut Replies) {
        self.end(PREFLIGHT_CALIBRATION, result, replies);
    }

    fn calibrates(&self) -> Option<&Command> {
        let under_way = self.under_way.as_ref();
        under_way.filter(|command| command.number == PREFLIGHT_CALIBRATION)
    }
}
