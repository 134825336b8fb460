//! STM32G431.

pub(crate) mod comparators;
pub(crate) mod pages;

use embassy_stm32::adc;
use embassy_stm32::pac;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::pwr::regs::Cr5;
use embassy_stm32::peripherals::ADC1;
use embassy_stm32::rcc::{
    self, Config, Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk, mux::Adcsel,
};
use embassy_stm32::{Peripherals, interrupt};

/// Clock of the timers.
pub const TIMER_HZ: u32 = 170_000_000;

/// External interrupts (RM0440, vector table).
pub(crate) const INTERRUPTS: usize = 102;

/// The interrupt at the end of the injected conversions.
pub(crate) const CONVERTED: interrupt::Interrupt = interrupt::ADC1_2;

/// Word of the converter's block at which the injected readings begin: JDR1 at 0x80.
pub(crate) const READINGS_AT_WORD: usize = 0x80 / 4;

/// Takes the interrupt's request back. The first converter's sequence is the longer one.
#[inline(always)]
pub(crate) fn acknowledge(converters: &[Adc; 2]) {
    converters[0].isr().write(|w| w.set_jeos(true));
}

/// Bit of PWR_CR5 that takes the core out of the boost which more than 150 MHz need (RM0440, 6.4.5).
/// The HAL's register has it at bit 0, which is none.
const R1MODE: u32 = 1 << 8;

/// Starts the chip: by its oscillator, until the core's voltage is up for 170 MHz.
pub(crate) fn start() -> Peripherals {
    let mut peripherals = embassy_stm32::init(embassy_stm32::Config::default());
    let supply = pac::PWR.cr5();
    supply.write_value(Cr5(supply.read().0 & !R1MODE));
    rcc::reinit(clock(), &mut peripherals.RCC);
    // Most of the program stands in the flash, which has four wait states and a small cache.
    pac::FLASH.acr().modify(|w| w.set_prften(true));
    peripherals
}

/// 170 MHz from the internal 16 MHz: sources disagree on the crystal's frequency.
fn clock() -> Config {
    let mut config = Config::new();
    config.hsi = true;
    config.pll = Some(Pll {
        source: PllSource::HSI,
        prediv: PllPreDiv::DIV4,
        mul: PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(PllRDiv::DIV2),
    });
    config.sys = Sysclk::PLL1_R;
    config.boost = true;
    config.mux.adc12sel = Adcsel::SYS;
    config
}

/// A processor that has locked up turns the bridge off by the timer's break.
pub(crate) fn break_on_lock_up() {
    pac::SYSCFG.cfgr2().modify(|w| w.set_cll(true));
}

/// A reading of one of the first converter's pins, between its injected ones.
pub(crate) struct Reading {
    _private: (),
}

impl Reading {
    /// Readings of a channel from 1 to 9. It takes the converter between the two steps of its set-up:
    /// without a clock nothing is kept, and once the injected sequence is armed what is sampled how long
    /// may not be changed (RM0440, ADC_SMPR1).
    pub(crate) fn new(_converter: &adc::Adc<'_, ADC1>, channel: u8) -> Self {
        let converter = pac::ADC1;
        converter.sqr1().write(|w| w.set_sq(0, channel));
        converter.smpr().modify(|w| {
            w.set_smp(channel.into(), pac::adc::vals::SampleTime::CYCLES247_5);
        });
        Self { _private: () }
    }

    /// The reading, of 4096. For the tasks: it waits for it, some 10 µs.
    pub(crate) fn counts(&mut self) -> u16 {
        let converter = pac::ADC1;
        converter.cr().modify(|w| w.set_adstart(true));
        while !converter.isr().read().eoc() {}
        converter.dr().read().rdata()
    }
}

/// Whether the watchdog has caused the last reset; to be asked once.
pub(crate) fn take_watchdog_reset() -> bool {
    let starved = pac::RCC.csr().read().iwdgrstf();
    // The flags stay until they are removed.
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    starved
}
