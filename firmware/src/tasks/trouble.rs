//! Trouble with the throttle wire on this chip: counted where it happens, reported by the tasks.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_time::{Duration, Instant};
use siskin_control::mavlink::Warning;

use crate::text::{push, push_decimal};

/// Time between two texts, so that they do not fill the link.
const APART: Duration = Duration::from_secs(5);

/// Counts of trouble since start-up.
pub(crate) struct Trouble {
    lost_edges: AtomicU32,
    late_replies: AtomicU32,
}

/// The counts.
pub(crate) static TROUBLE: Trouble = Trouble {
    lost_edges: AtomicU32::new(0),
    late_replies: AtomicU32::new(0),
};

impl Trouble {
    /// Counts edges that came faster than they were taken in.
    pub(crate) fn lost_edges(&self) {
        self.lost_edges.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts a reply that was not ready in time and not sent.
    pub(crate) fn late_reply(&self) {
        self.late_replies.fetch_add(1, Ordering::Relaxed);
    }
}

/// Warns the user of new trouble at intervals.
pub(crate) struct Teller {
    told: [u32; 2],
    told_at: Instant,
}

impl Teller {
    /// Creates it with nothing reported.
    pub(crate) const fn new() -> Self {
        Self {
            told: [0; 2],
            told_at: Instant::MIN,
        }
    }

    /// Returns the warning that is due, if any.
    pub(crate) fn next(&mut self, now: Instant) -> Option<Warning> {
        let counts =
            [&TROUBLE.lost_edges, &TROUBLE.late_replies].map(|count| count.load(Ordering::Relaxed));
        if counts == self.told || now - self.told_at < APART {
            return None;
        }
        self.told = counts;
        self.told_at = now;
        let mut text = Warning::new();
        let [lost, late] = counts;
        // At most 47 characters: it fits.
        push(&mut text, "Throttle: ");
        push_decimal(&mut text, lost);
        push(&mut text, " gaps, ");
        push_decimal(&mut text, late);
        push(&mut text, " late replies");
        Some(text)
    }
}
