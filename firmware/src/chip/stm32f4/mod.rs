//! STM32F405.

mod clock;
pub(crate) mod pages;

use embassy_stm32::Peripherals;
use embassy_stm32::interrupt;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::regs::Sr;
use embassy_stm32::pac::timer::vals::FilterValue;
use embassy_stm32::pac::{DBGMCU, EXTI, FLASH, RCC, SYSCFG};

pub(crate) use clock::clock_trouble;

use super::Reset;

/// Clock of the timers on APB2; those on APB1 run at half of it.
pub const TIMER_HZ: u32 = 168_000_000;

/// External interrupts (RM0090, vector table).
pub(crate) const INTERRUPTS: usize = 82;

/// The interrupt at the end of the injected conversions.
pub(crate) const CONVERTED: interrupt::Interrupt = interrupt::ADC;

/// The interrupt of EXTI lines 10 to 15.
pub(crate) const ALARM: interrupt::Interrupt = interrupt::EXTI15_10;

/// Rejects spikes below 83 ns on the throttle wire, as on the other chip: eight samples at the timer's 84 MHz.
pub(crate) const EDGE_FILTER: FilterValue = FilterValue::FCK_INT_N8;

/// Word offset of the injected readings in a converter's registers: JDR1 at 0x3c.
pub(crate) const READINGS_AT_WORD: usize = 0x3c / 4;

/// Clears the interrupt request. Both sequences are equally long.
#[inline(always)] // in each period
pub(crate) fn acknowledge(converters: &[Adc; 2]) {
    // Writing 1 leaves bits unchanged.
    let mut others = Sr(!0);
    others.set_jeoc(false);
    converters[0].sr().write_value(others);
}

/// Starts the chip.
pub(crate) fn start() -> Peripherals {
    let peripherals = embassy_stm32::init(clock::config());
    clock::watch();
    pages::watch_supply();
    // The HAL wrote the whole register with nothing but the wait states (embassy-stm32 0.6). A fetch of four
    // instructions or more then takes six clocks, most of which caches and prefetch save (RM0090, 3.5).
    let id = DBGMCU.idcode().read();
    FLASH.acr().modify(|w| {
        w.set_icen(true);
        w.set_dcen(true);
        w.set_prften(id.dev_id() == STM32F405 && id.rev_id() != REVISION_A);
    });
    peripherals
}

/// Device ID of these chips (RM0090, DBGMCU_IDCODE). Revision A, whose prefetch must stay off (ES0182), can
/// show another: 0x411, with revision 0x2000.
const STM32F405: u16 = 0x413;

/// Revision A according to RM0090.
const REVISION_A: u16 = 0x1000;

/// Lets a falling edge on a pin of port C, 10 to 15, request [`ALARM`].
pub(crate) fn detect(pin: usize) {
    RCC.apb2enr().modify(|w| w.set_syscfgen(true));
    SYSCFG.exticr(pin / 4).modify(|w| w.set_exti(pin % 4, 2));
    EXTI.ftsr(0).modify(|w| w.set_line(pin, true));
}

/// Clears that request.
pub(crate) fn heard(pin: usize) {
    EXTI.pr(0).write(|w| w.set_line(pin, true));
}

/// Returns what caused the last reset. Call it only once.
pub(crate) fn take_reset() -> Reset {
    let causes = RCC.csr().read();
    // The flags persist until cleared.
    RCC.csr().modify(|w| w.set_rmvf(true));
    Reset {
        power_up: causes.porrstf(),
        starved: causes.wdgrstf(),
    }
}
