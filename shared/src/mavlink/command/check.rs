//! RUN_PREARM_CHECKS: the self-test. It takes most of a second and is acknowledged step by step. USER_1: the
//! identification of the motor, which takes some ten seconds; parameter 1 is 1 to begin it, 0 to end it, and 2 to keep
//! its results. A write of MOT_IDENTIFY does the same.

use mavlink::dialects::ardupilotmega::{MavResult, MavSeverity};

use super::{
    ACCEPTED, Act, Address, Command, Commands, Context, DENIED, DriveStatus, IDENTIFY, IN_PROGRESS,
    RUN_PREARM_CHECKS, Replies, Reply, TEMPORARILY_REJECTED,
};

/// How long a client may leave out its heartbeats, µs; they come once a second.
const GONE_US: u32 = 3_500_000;

impl Commands {
    /// Takes a client's heartbeat.
    pub(in super::super) fn heartbeat(&mut self, now_us: u64, from: Address) {
        if self
            .under_way
            .as_ref()
            .is_some_and(|command| command.from == from)
        {
            self.beat_us = Some(now_us as u32);
        }
    }

    /// Ends an identification whose client has gone: nobody is there to end it. One that sends no heartbeats cannot be
    /// missed.
    pub(in super::super) fn poll(&mut self, now_us: u64) {
        let identifies = |command: &Command| command.number == IDENTIFY;
        let gone = |beat_us| (now_us as u32).wrapping_sub(beat_us) > GONE_US;
        if self.under_way.as_ref().is_some_and(identifies) && self.beat_us.is_some_and(gone) {
            self.act = Some(Act::AbandonIdentification);
        }
    }

    /// Begins or ends an identification, or keeps its results.
    pub(super) fn identify(
        &mut self,
        command: &Command,
        drive: DriveStatus,
        context: &mut Context,
        replies: &mut Replies,
    ) -> MavResult {
        let act = match command.choice(0) {
            Some(0) => {
                self.act = Some(Act::EndIdentification);
                return ACCEPTED;
            }
            Some(1) => Act::Identify,
            Some(2) => Act::KeepIdentified,
            _ => return DENIED,
        };
        let barred = act == Act::Identify && context.authority.barred();
        let result = if barred {
            TEMPORARILY_REJECTED
        } else {
            self.measure(command, act, drive, context)
        };
        if result == TEMPORARILY_REJECTED {
            let reason = if barred {
                "settings lost or defect"
            } else if drive.faulted {
                "a fault holds"
            } else if !drive.stopped {
                "the motor turns"
            } else if self.is_busy() {
                "busy"
            } else {
                "the throttle is open"
            };
            let text = ["Not now: ", reason];
            replies.push(Reply::Text(MavSeverity::MAV_SEVERITY_WARNING, text));
        }
        result
    }

    /// Begins what uses the bridge, under the rule of what may turn a motor.
    pub(super) fn measure(
        &mut self,
        command: &Command,
        act: Act,
        drive: DriveStatus,
        context: &mut Context,
    ) -> MavResult {
        if self.is_busy() || !context.authority.may_test(context.now_us, drive) {
            return TEMPORARILY_REJECTED;
        }
        self.under_way = Some(*command);
        self.beat_us = None;
        self.act = Some(act);
        IN_PROGRESS
    }

    /// Reports the self-test's progress, percent.
    pub(in super::super) fn check_progress(&self, percent: u8, replies: &mut Replies) {
        if let Some(command) = self.under_way.as_ref().filter(|command| measures(command)) {
            replies.progress(command.from, command.number, percent);
        }
    }

    /// Returns true if a requested self-test is running.
    pub(super) fn checks(&self) -> bool {
        self.under_way.as_ref().is_some_and(measures)
    }
}

fn measures(command: &Command) -> bool {
    matches!(command.number, RUN_PREARM_CHECKS | IDENTIFY)
}
