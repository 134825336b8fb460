//! The time, as the tasks have it.

use embassy_time::Instant;

/// The time. Never inlined: the driver's code would stand in each place that asks for it.
#[inline(never)]
pub(super) fn now() -> Instant {
    Instant::now()
}
