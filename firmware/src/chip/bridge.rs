//! The bridge's timer, TIM1 on these chips.

use embassy_stm32::pac::TIM1;
use embassy_stm32::pac::timer::TimAdv;

/// The timer that drives the gates.
pub(crate) const TIMER: TimAdv = TIM1;

/// Turns all switches off at once. May be called at any time, even before the timer is set up.
// Always inlined: an out-of-line function would be in flash, which may be busy.
#[inline(always)]
pub(crate) fn turn_off(timer: TimAdv) {
    timer.bdtr().modify(|w| w.set_moe(false));
}
