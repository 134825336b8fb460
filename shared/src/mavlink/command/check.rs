//! RUN_PREARM_CHECKS: the self-test. It takes most of a second, and is acknowledged step by step.

use mavlink::dialects::ardupilotmega::MavResult;

use super::{
    Act, Command, Commands, Context, DriveStatus, IN_PROGRESS, RUN_PREARM_CHECKS, Replies,
    TEMPORARILY_REJECTED,
};

impl Commands {
    /// The bridge is used for it: under the rule of what may turn a motor.
    pub(super) fn check(
        &mut self,
        command: &Command,
        drive: DriveStatus,
        context: &mut Context,
    ) -> MavResult {
        if self.is_busy() || !context.authority.may_test(context.now_us, drive) {
            return TEMPORARILY_REJECTED;
        }
        self.under_way = Some(*command);
        self.act = Some(Act::Check);
        IN_PROGRESS
    }

    /// The self-test is so far, percent.
    pub(in super::super) fn check_progress(&self, percent: u8, replies: &mut Replies) {
        let under_way = self.under_way.as_ref();
        if let Some(command) = under_way.filter(|command| command.number == RUN_PREARM_CHECKS) {
            replies.progress(command.from, command.number, percent);
        }
    }

    /// Returns true if a self-test was asked for, and goes on.
    pub(super) fn checks(&self) -> bool {
        let under_way = self.under_way.as_ref();
        under_way.is_some_and(|command| command.number == RUN_PREARM_CHECKS)
    }

    /// The self-test has this result, if one was asked for.
    pub(in super::super) fn end_check(&mut self, result: MavResult, replies: &mut Replies) {
        self.end(RUN_PREARM_CHECKS, result, replies);
    }
}
