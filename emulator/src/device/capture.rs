//! The timer that captures the throttle wire's edges: conversion of its counts.

/// Rate of the timer that captures the wire's edges: that of the STM32G431.
pub(super) const CAPTURE_HZ: u32 = 170_000_000;

/// The greatest rate that divides both the timer's and that of nanoseconds.
const STEP_HZ: u32 = 10_000_000;

/// Returns the capture timer's count at a time.
pub(super) fn ticks(time_ns: u64) -> u32 {
    // Called in each control period: a 64-bit product, which lasts 34 years, takes a fifth of the time of a wider one.
    (time_ns * u64::from(CAPTURE_HZ / STEP_HZ) / u64::from(1_000_000_000 / STEP_HZ)) as u32
}

/// Returns when the capture timer shows a count: the time nearest to `near_ns`, rounded up to a nanosecond.
pub(super) fn time_ns(at_ticks: u32, near_ns: u64) -> u64 {
    let since = at_ticks.wrapping_sub(ticks(near_ns)) as i32;
    let near = u128::from(near_ns) * u128::from(CAPTURE_HZ) / 1_000_000_000;
    let count = near.saturating_add_signed(since.into());
    (count * 1_000_000_000).div_ceil(u128::from(CAPTURE_HZ)) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_is_the_time_at_which_it_begins() {
        // Ticks of 5.88 ns; the timer wraps every 25.26 s.
        for near_ns in [0, 1_000, 30_000_000_123, 90_000_000_000_000] {
            for ahead_ns in [0, 1, 5, 6, 56_667, 1_000_000] {
                let then_ns = near_ns + ahead_ns;
                for back in [(then_ns, near_ns), (near_ns, then_ns)] {
                    let told_ns = time_ns(ticks(back.0), back.1);
                    assert!(told_ns <= back.0 && back.0 - told_ns < 6, "{back:?}");
                    assert_eq!(ticks(told_ns), ticks(back.0));
                }
            }
        }
    }
}
