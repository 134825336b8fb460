//! Simulated time in step with wall time.

use std::time::{Duration, Instant};

/// Wall time between two reads of the sockets.
const SLICE: Duration = Duration::from_millis(1);

/// Lag behind the wall clock that is dropped rather than caught up: the machine slept.
const GIVEN_UP: Duration = Duration::from_millis(500);

/// The most that is simulated between two looks at the sockets and at a request to end, ns: it takes less than a second
/// for eight ESCs with every switching edge, on a slow machine.
const LONGEST_SLICE_NS: u64 = 20_000_000;

/// A control period at the lowest PWM frequency, 8 kHz, plus a margin, ns.
const LONGEST_PERIOD_NS: u64 = 130_000;

/// How fast simulated time passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// This many simulated seconds per second.
    Times(f64),
    /// As fast as the machine can.
    Max,
}

/// Keeps simulated time in step with wall time.
pub(super) struct Pacer {
    pace: Pace,
    pub(super) began: Instant,
    /// Where the two clocks last met: wall time since the start, and simulated ns.
    met: (Duration, u64),
}

impl Pacer {
    pub(super) fn new(pace: Pace) -> Self {
        Self {
            pace,
            began: Instant::now(),
            met: (Duration::ZERO, 0),
        }
    }

    /// Returns how far to simulate now, in slices of a millisecond of wall time.
    pub(super) fn until_ns(&mut self, now_ns: u64) -> u64 {
        let Pace::Times(times) = self.pace else {
            return now_ns + LONGEST_SLICE_NS;
        };
        let wall = self.began.elapsed();
        let due_ns = self.met.1 + ((wall - self.met.0).as_secs_f64() * times * 1e9) as u64;
        if due_ns.saturating_sub(now_ns) > (GIVEN_UP.as_secs_f64() * times * 1e9) as u64 {
            self.met = (wall, now_ns);
        }
        due_ns.min(now_ns + slice_ns(times))
    }

    /// Sleeps until a slice is due.
    pub(super) fn wait(&self, now_ns: u64) {
        let Pace::Times(times) = self.pace else {
            return;
        };
        let simulated_s = (now_ns + slice_ns(times) - self.met.1) as f64 * 1e-9;
        let due = self.met.0 + Duration::from_secs_f64(simulated_s / times);
        std::thread::sleep(due.saturating_sub(self.began.elapsed()));
    }
}

/// Returns what is simulated in a millisecond of wall time, as far as that is not too much at once; in slow motion at
/// least a control period.
fn slice_ns(times: f64) -> u64 {
    ((SLICE.as_nanos() as f64 * times) as u64).clamp(LONGEST_PERIOD_NS, LONGEST_SLICE_NS)
}
