//! STM32G431.

mod clock;
pub(crate) mod comparators;
pub(crate) mod converters;
pub(crate) mod op_amps;
pub(crate) mod pages;
pub(crate) mod pins;

use embassy_stm32::interrupt;
use embassy_stm32::pac;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::timer::vals::FilterValue;

use super::Reset;

pub(crate) use clock::{clock_trouble, hal_baud, start};

/// Clock of the timers.
pub const TIMER_HZ: u32 = 170_000_000;

/// External interrupts (RM0440, vector table).
pub(crate) const INTERRUPTS: usize = 102;

/// The interrupt at the end of the injected conversions.
pub(crate) const CONVERTED: interrupt::Interrupt = interrupt::ADC1_2;

/// Rejects spikes below 82 ns on the throttle wire: seven intervals between eight samples, at half of the timer's
/// clock. DShot1200's shortest level is 313 ns, and both edges come later by as much. ESCape32 takes eight samples at
/// the chip's clock, of 48 to 170 MHz: up to 146 ns.
pub(crate) const EDGE_FILTER: FilterValue = FilterValue::FDTS_DIV2_N8;

/// Word offset of the injected readings in a converter's registers: JDR1 at 0x80.
pub(crate) const READINGS_AT_WORD: usize = 0x80 / 4;

/// Clears the interrupt request. The first converter's sequence is the longer one.
#[inline(always)] // in each period
pub(crate) fn acknowledge(converters: &[Adc; 2]) {
    converters[0].isr().write(|w| w.set_jeos(true));
}

/// Makes a processor lockup turn the bridge off, by the timer's break.
pub(crate) fn break_on_lock_up() {
    pac::SYSCFG.cfgr2().modify(|w| w.set_cll(true));
}

/// Returns what caused the last reset. Call it only once.
pub(crate) fn take_reset() -> Reset {
    let causes = pac::RCC.csr().read();
    // The flags persist until cleared.
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    Reset {
        // A power-up sets it too (RM0440, 7.4.29).
        power_up: causes.borrstf(),
        starved: causes.iwdgrstf(),
    }
}
