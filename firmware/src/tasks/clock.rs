//! The tasks' time.

use embassy_time::Instant;

/// Returns the time. Never inlined: the driver's code would be copied to every caller.
#[inline(never)]
pub(super) fn now() -> Instant {
    Instant::now()
}
