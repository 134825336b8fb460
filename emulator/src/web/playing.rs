//! A scenario played on a running ESC: its throttle on the wire, its faults as they begin.
//!
//! A page has begun it, and holds the throttle for it: it ends with the page, and when anyone else takes the wire.

use std::time::Instant;

use siskin_scope::ViewerId;

use super::throttle::Throttle;
use crate::machine::Machine;
use crate::scenario::Script;

/// `INP_PROTO` of any signal.
const ANY_SIGNAL: u8 = 0;

/// A scenario in progress.
pub(super) struct Playing {
    viewer: ViewerId,
    script: Script,
    begun_ns: u64,
    /// Number of faults that have begun.
    begun: usize,
}

/// Its progress.
pub(super) enum Stage {
    /// It goes on.
    GoesOn,
    /// It has been played to its end.
    Over,
    /// It cannot go on; why, in a line.
    Refused(String),
}

impl Playing {
    /// Begins now.
    pub(super) fn new(viewer: ViewerId, script: Script, now_ns: u64) -> Self {
        Self {
            viewer,
            script,
            begun_ns: now_ns,
            begun: 0,
        }
    }

    /// Returns who has begun it.
    pub(super) fn viewer(&self) -> ViewerId {
        self.viewer
    }

    /// Returns what is played.
    pub(super) fn script(&self) -> &Script {
        &self.script
    }

    /// Does what is due.
    pub(super) fn play(
        &mut self,
        now: Instant,
        throttle: &mut Throttle,
        esc: usize,
        machine: &mut impl Machine,
    ) -> Stage {
        let now_ns = machine.now_ns();
        let t_s = (now_ns - self.begun_ns) as f64 * 1e-9;
        while let Some(due) = self.script.faults().get(self.begun)
            && due.at_s <= t_s
        {
            let mut fault = *due;
            fault.at_s = now_ns as f64 * 1e-9;
            self.begun += 1;
            if let Err(reason) = machine.inject(esc, fault) {
                return Stage::Refused(reason.to_owned());
            }
        }
        let Some(value) = self.script.throttle(t_s) else {
            throttle.release(self.viewer, now);
            return Stage::Over;
        };
        let asked = throttle.ask(
            (self.viewer, now),
            (value, ANY_SIGNAL),
            machine.wire(esc),
            now_ns,
        );
        match asked {
            Ok(()) => Stage::GoesOn,
            Err(refused) => {
                throttle.release(self.viewer, now);
                Stage::Refused(refused.line().to_owned())
            }
        }
    }
}
