//! The faults that have been reported in words, and the times.

use crate::drive::{Fault, Faults};

/// Least time between two texts of a fault's beginning, and between two of its end: a fault that
/// comes and goes each millisecond must not fill the link.
const APART_US: u64 = 1_000_000;

/// A fault that has begun or ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FaultEvent {
    Began(Fault),
    Ended(Fault),
}

/// The state of each fault as reported last.
#[derive(Clone, Debug)]
pub(super) struct Announcer {
    told: [bool; Fault::ALL.len()],
    began_us: [Option<u64>; Fault::ALL.len()],
    ended_us: [Option<u64>; Fault::ALL.len()],
}

impl Announcer {
    pub(super) const fn new() -> Self {
        Self {
            told: [false; Fault::ALL.len()],
            began_us: [None; Fault::ALL.len()],
            ended_us: [None; Fault::ALL.len()],
        }
    }

    /// The next fault whose state differs from the one reported and may be reported now. What has to wait
    /// is reported later if it still differs then.
    pub(super) fn next(&mut self, now_us: u64, faults: Faults) -> Option<FaultEvent> {
        for (i, fault) in Fault::ALL.into_iter().enumerate() {
            let present = faults.contains(fault);
            if present == self.told[i] {
                continue;
            }
            let last_us = if present {
                &mut self.began_us[i]
            } else {
                &mut self.ended_us[i]
            };
            if last_us.is_some_and(|last_us| now_us.saturating_sub(last_us) < APART_US) {
                continue;
            }
            *last_us = Some(now_us);
            self.told[i] = present;
            return Some(if present {
                FaultEvent::Began(fault)
            } else {
                FaultEvent::Ended(fault)
            });
        }
        None
    }
}
