//! The faults reported in words, and when.

use crate::drive::{Fault, Faults};

/// Least time between two texts about a fault's beginning, and between two about its end: a fault that comes and goes
/// every millisecond must not fill the link.
const APART_US: u64 = 1_000_000;

/// A fault that has begun or ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FaultEvent {
    Began(Fault),
    Ended(Fault),
}

/// The last reported state of each fault.
#[derive(Clone, Debug)]
pub(super) struct Announcer {
    told: Faults,
    /// When the end, and when the beginning, may next be reported, µs.
    due_us: [[u64; Fault::ALL.len()]; 2],
}

impl Announcer {
    pub(super) const fn new() -> Self {
        Self {
            told: Faults::NONE,
            due_us: [[0; Fault::ALL.len()]; 2],
        }
    }

    /// Returns the next fault whose state differs from the reported one and may be reported now. One that has to wait
    /// is reported later if it still differs.
    pub(super) fn next(&mut self, now_us: u64, faults: Faults) -> Option<FaultEvent> {
        let began = faults.without(self.told);
        let ended = self.told.without(faults);
        for fault in began.with(ended).iter() {
            let present = faults.contains(fault);
            let due_us = &mut self.due_us[usize::from(present)][fault as usize];
            if now_us < *due_us {
                continue;
            }
            *due_us = now_us + APART_US;
            self.told.toggle(fault);
            return Some(if present {
                FaultEvent::Began(fault)
            } else {
                FaultEvent::Ended(fault)
            });
        }
        None
    }
}
