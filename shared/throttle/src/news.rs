//! News of the wire for the user.

use super::calibration::Step;
use super::signal::Signal;

/// The minimum time between two news of the same kind, µs: a wire that keeps failing must not fill the MAVLink
/// link.
const APART_US: u64 = 1_000_000;

/// How long throttle must be open before the ESC complains, µs.
const OPEN_US: u64 = 500_000;
/// The same of a wire whose signal is not known; plugging it in makes some edges.
const UNKNOWN_US: u64 = 2_500_000;
/// Time between two complaints, µs.
const AGAIN_US: u64 = 3_000_000;

/// News to tell in words or by a tune.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum News {
    /// The wire carries this signal.
    Identified(Signal),
    /// The wire carries something for a while, but no signal that is known.
    Unknown,
    /// The signal was lost.
    Lost {
        /// The wire was armed.
        armed: bool,
    },
    /// The wire is armed.
    Armed,
    /// The wire demands throttle, but must show zero throttle first.
    OpenThrottle,
    /// A step of the stick calibration.
    Calibration(Step),
}

/// The current state of the wire.
#[derive(Clone, Copy, Debug)]
pub(super) struct Standing {
    /// The identified signal, while present.
    pub(super) signal: Option<Signal>,
    pub(super) armed: bool,
    /// There is no signal, and most of the last second's edges were neither frame nor pulse.
    pub(super) unknown: bool,
    /// The wire demands throttle without being armed, and it is not a calibration.
    pub(super) open: bool,
}

/// Tracks what has been reported.
#[derive(Clone, Debug, Default)]
pub(super) struct Announcer {
    signal: Option<Signal>,
    identified_us: Option<u64>,
    /// A loss still to be reported; true if the wire was armed.
    loss: Option<bool>,
    lost_us: Option<u64>,
    armed: bool,
    open: Complaint,
    unknown: Complaint,
    step: Option<Step>,
}

impl Announcer {
    /// Records a lost signal.
    pub(super) fn lost(&mut self, armed: bool) {
        // Noise looks like signals that come and go; unreported ones are not worth a loss.
        if armed || self.signal.is_some() {
            self.loss = Some(armed || self.loss == Some(true));
        }
    }

    /// Records a calibration step.
    pub(super) fn calibration(&mut self, step: Option<Step>) {
        self.step = step.or(self.step);
    }

    /// Returns the next news. Call it until it returns `None`.
    pub(super) fn next(&mut self, now_us: u64, standing: Standing) -> Option<News> {
        if let Some(armed) = self.loss
            && is_apart(now_us, self.lost_us, APART_US)
        {
            self.loss = None;
            self.lost_us = Some(now_us);
            self.signal = None;
            // It may have been armed again since.
            self.armed = false;
            return Some(News::Lost { armed });
        }
        if let Some(signal) = standing.signal
            && self.loss.is_none()
            && self.signal != standing.signal
            && is_apart(now_us, self.identified_us, APART_US)
        {
            self.signal = standing.signal;
            self.identified_us = Some(now_us);
            return Some(News::Identified(signal));
        }
        if core::mem::replace(&mut self.armed, standing.armed) != standing.armed && standing.armed {
            return Some(News::Armed);
        }
        if let Some(step) = self.step.take() {
            return Some(News::Calibration(step));
        }
        if self.open.is_due(now_us, standing.open, OPEN_US) {
            return Some(News::OpenThrottle);
        }
        (self.unknown.is_due(now_us, standing.unknown, UNKNOWN_US)).then_some(News::Unknown)
    }
}

/// Something that is told once it has lasted, and again while it lasts.
#[derive(Clone, Debug, Default)]
struct Complaint {
    since_us: Option<u64>,
    told_us: Option<u64>,
}

impl Complaint {
    // Two callers, each in turn.
    #[inline(never)]
    fn is_due(&mut self, now_us: u64, holds: bool, lasts_us: u64) -> bool {
        if !holds {
            self.since_us = None;
            return false;
        }
        let since_us = *self.since_us.get_or_insert(now_us);
        let lasted = now_us.saturating_sub(since_us) >= lasts_us;
        let is_due = lasted && is_apart(now_us, self.told_us, AGAIN_US);
        if is_due {
            self.told_us = Some(now_us);
        }
        is_due
    }
}

fn is_apart(now_us: u64, last_us: Option<u64>, apart_us: u64) -> bool {
    last_us.is_none_or(|last_us| now_us.saturating_sub(last_us) >= apart_us)
}
