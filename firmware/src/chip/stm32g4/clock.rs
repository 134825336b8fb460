//! Clock: 170 MHz from the internal 16 MHz, since sources disagree on the crystal's frequency.
//!
//! The HAL starts the chip from that oscillator and does not learn of the rest: its own path to 170 MHz takes
//! 1.5 KB and leaves the core supply in the wrong mode (see [`R1MODE`]). Two users rely on the HAL's clock: the
//! time driver's timer, which is corrected here, and the serial lines, whose rates [`hal_baud`] converts for
//! the HAL.

use embassy_stm32::pac::flash::vals::Latency;
use embassy_stm32::pac::pwr::regs::Cr5;
use embassy_stm32::pac::rcc::vals::Pllsrc;
use embassy_stm32::pac::timer::vals::Urs;
use embassy_stm32::pac::{FLASH, PWR, RCC, TIM4};
use embassy_stm32::rcc::mux::{Adcsel, Uartsel, Usart1sel};
use embassy_stm32::rcc::{AHBPrescaler, PllMul, PllPreDiv, PllRDiv, Sysclk};
use embassy_stm32::{Config, Peripherals};
use embassy_time::TICK_HZ;

use super::TIMER_HZ;

/// The clock the HAL assumes.
const TOLD_HZ: u32 = 16_000_000;

/// Bit of PWR_CR5 that takes the core out of the boost mode required above 150 MHz (RM0440, 6.4.5). The HAL's
/// register has it at bit 0, which does not exist.
const R1MODE: u32 = 1 << 8;

/// Starts the chip: processor, buses, serial lines and converters run at [`TIMER_HZ`].
pub(crate) fn start() -> Peripherals {
    let mut config = Config::default();
    config.rcc.hsi48 = None;
    config.rcc.mux.adc12sel = Adcsel::SYS;
    config.rcc.mux.usart1sel = Usart1sel::SYS;
    config.rcc.mux.usart2sel = Uartsel::SYS;
    let peripherals = embassy_stm32::init(config);
    speed_up();
    // Keep the time driver's timer at its rate.
    TIM4.psc()
        .write_value((TIMER_HZ / TICK_HZ as u32 - 1) as u16);
    TIM4.cr1().modify(|w| w.set_urs(Urs::COUNTER_ONLY));
    TIM4.egr().write(|w| w.set_ug(true));
    TIM4.cr1().modify(|w| w.set_urs(Urs::ANY_EVENT));
    peripherals
}

/// Switches to the PLL. Above 150 MHz the core supply must be boosted, and half the clock applied for 1 µs
/// first (RM0440, 6.1.5).
fn speed_up() {
    let supply = PWR.cr5();
    supply.write_value(Cr5(supply.read().0 & !R1MODE));
    RCC.pllcfgr().write(|w| {
        w.set_pllsrc(Pllsrc::HSI);
        w.set_pllm(PllPreDiv::DIV4);
        w.set_plln(PllMul::MUL85);
        w.set_pllr(PllRDiv::DIV2);
        w.set_pllren(true);
    });
    RCC.cr().modify(|w| w.set_pllon(true));
    while !RCC.cr().read().pllrdy() {}
    // Most of the program runs from flash, with four wait states and a small cache.
    FLASH.acr().modify(|w| {
        w.set_latency(Latency::WS4);
        w.set_prften(true);
    });
    while FLASH.acr().read().latency() != Latency::WS4 {}
    // Must be in force before the PLL is (RM0440, 6.1.5).
    RCC.cfgr().modify(|w| w.set_hpre(AHBPrescaler::DIV2));
    while RCC.cfgr().read().hpre() != AHBPrescaler::DIV2 {}
    RCC.cfgr().modify(|w| w.set_sw(Sysclk::PLL1_R));
    while RCC.cfgr().read().sws() != Sysclk::PLL1_R {}
    // 1 µs at 85 MHz.
    cortex_m::asm::delay(85);
    RCC.cfgr().modify(|w| w.set_hpre(AHBPrescaler::DIV1));
}

/// Returns nothing: the internal oscillator is the only one.
pub(crate) const fn clock_trouble() -> Option<&'static str> {
    None
}

/// Converts a serial baud rate for the HAL, which derives its divider from its own clock.
pub(crate) const fn hal_baud(rate_hz: u32) -> u32 {
    // `TEL_BAUD` goes up to 921 600, where the HAL divides by 184 and the rate is 0.25 % off.
    let mega = TIMER_HZ / 1_000_000;
    (rate_hz * (TOLD_HZ / 1_000_000) + mega / 2) / mega
}
