//! STM32G431.

pub(crate) mod comparators;
pub(crate) mod pages;

use embassy_stm32::adc;
use embassy_stm32::pac;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::flash::vals::Latency;
use embassy_stm32::pac::pwr::regs::Cr5;
use embassy_stm32::pac::timer::vals::Urs;
use embassy_stm32::peripherals::ADC1;
use embassy_stm32::rcc::{
    self, AHBPrescaler, Config, Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk,
    mux::{Adcsel, Uartsel, Usart1sel},
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
    rcc::reinit(half_clock(), &mut peripherals.RCC);
    double_clock();
    // Most of the program stands in the flash, which has four wait states and a small cache.
    pac::FLASH.acr().modify(|w| w.set_prften(true));
    peripherals
}

/// 170 MHz from the internal 16 MHz, since sources disagree on the crystal's frequency; and half of it for
/// the processor and its buses.
///
/// Above 150 MHz the core's supply wants to see half of it for 1 µs (RM0440, 6.1.5), where the HAL makes one
/// step. It counts with this half from then on: what has the system's clock is as it believes, and what has
/// the buses' is seen to in [`double_clock`].
fn half_clock() -> Config {
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
    config.ahb_pre = AHBPrescaler::DIV2;
    config.boost = true;
    config.mux.adc12sel = Adcsel::SYS;
    config.mux.usart1sel = Usart1sel::SYS;
    config.mux.usart2sel = Uartsel::SYS;
    config
}

/// The other half: processor and buses at 170 MHz.
fn double_clock() {
    // 1 µs of 85 MHz.
    cortex_m::asm::delay(85);
    pac::FLASH.acr().modify(|w| w.set_latency(Latency::WS4));
    while pac::FLASH.acr().read().latency() != Latency::WS4 {}
    (pac::RCC.cfgr()).modify(|w| w.set_hpre(AHBPrescaler::DIV1));
    // Of what is used only the HAL's clock has that of a bus, and counts with half of it.
    let timer = pac::TIM4;
    timer.psc().modify(|divider| *divider = 2 * *divider + 1);
    timer.cr1().modify(|w| w.set_urs(Urs::COUNTER_ONLY));
    timer.egr().write(|w| w.set_ug(true));
    timer.cr1().modify(|w| w.set_urs(Urs::ANY_EVENT));
}

/// A processor that has locked up turns the bridge off by the timer's break.
pub(crate) fn break_on_lock_up() {
    pac::SYSCFG.cfgr2().modify(|w| w.set_cll(true));
}

/// Tries of a reading, so that a task is not held up for ever.
const TRIES: u32 = 8;

/// A reading of one of the first converter's pins, between its injected ones.
pub(crate) struct Reading {
    /// The last one that no injected conversion came near.
    counts: u16,
}

impl Reading {
    /// Readings of a channel from 1 to 9. It takes the converter between the two steps of its set-up:
    /// without a clock nothing is kept, and once the injected sequence is armed what is sampled how long
    /// may not be changed (RM0440, ADC_SMPR1).
    pub(crate) fn new(_converter: &adc::Adc<'_, ADC1>, channel: u8) -> Self {
        let converter = pac::ADC1;
        converter.sqr1().write(|w| w.set_sq(0, channel));
        converter.smpr().modify(|w| {
            w.set_smp(channel.into(), pac::adc::vals::SampleTime::CYCLES92_5);
        });
        Self { counts: 0 }
    }

    /// The reading, of 4096. For the tasks: it waits for it, some 8 µs, or as often as it is disturbed.
    /// `periods` counts the control periods, each of which follows injected conversions.
    ///
    /// A regular conversion after injected ones may be one of channel 0 (ES0431, 2.5.8): it counts where
    /// another stands before it and no period has gone by since. Both take half of the fastest PWM's
    /// period; where something else holds them up each time, the reading before stands.
    pub(crate) fn counts(&mut self, periods: impl Fn() -> u32) -> u16 {
        for _ in 0..TRIES {
            let before = periods();
            self.convert();
            let counts = self.convert();
            if periods() == before {
                self.counts = counts;
                break;
            }
        }
        self.counts
    }

    fn convert(&mut self) -> u16 {
        let converter = pac::ADC1;
        converter.cr().modify(|w| w.set_adstart(true));
        while !converter.isr().read().eoc() {}
        converter.dr().read().rdata()
    }
}

/// Returns true if the watchdog has caused the last reset; to be asked once.
pub(crate) fn take_watchdog_reset() -> bool {
    let starved = pac::RCC.csr().read().iwdgrstf();
    // The flags stay until they are removed.
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    starved
}
