//! Delay of the timer that paces replies before their first bit.

/// Returns the pacing timer's period for a delay in capture ticks: its clocks less one. `None` if the time has
/// passed, is further off than any reply, or is so near that the period would be 0, which stops the timer.
pub(crate) fn delay_clocks(ticks: u32, clocks_per_tick: u32) -> Option<u16> {
    let period = ticks.checked_mul(clocks_per_tick)?.checked_sub(1)?;
    u16::try_from(period).ok().filter(|period| *period > 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_is_never_nought() {
        // 0 ticks, 1 tick, and a time that has just passed.
        for ticks in [0, 1, u32::MAX] {
            assert_eq!(delay_clocks(ticks, 1), None, "{ticks}");
        }
        assert_eq!(delay_clocks(2, 1), Some(1));
        assert_eq!(delay_clocks(1, 4), Some(3));
        // 30 us at 170 MHz.
        assert_eq!(delay_clocks(5100, 1), Some(5099));
        assert_eq!(delay_clocks(65_536, 1), Some(u16::MAX));
        assert_eq!(delay_clocks(65_537, 1), None);
    }
}
