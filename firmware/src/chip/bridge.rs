//! The bridge's timer: TIM1 on these chips.

use embassy_stm32::pac::TIM1;
use embassy_stm32::pac::timer::TimAdv;

/// The timer that drives the gates.
pub(crate) const TIMER: TimAdv = TIM1;

/// Turns all switches off, at once. It may be called at any time, also before the timer is set up.
// Always inlined: as a function it would lie in the flash, which may be busy.
#[inline(always)]
pub(crate) fn turn_off(timer: TimAdv) {
    timer.bdtr().modify(|w| w.set_moe(false));
}
