//! Clock: 168 MHz from the 8 MHz crystal, or from the internal 16 MHz if that does not start.
//!
//! All boards of this class have the crystal: the VESC firmware has no other clock for them (`hwconf/board.h` and
//! `mcuconf.h` there), and waits for it forever. The internal oscillator is up to 4 % off between −10 and 85 °C, and
//! 8 % beyond (DS8626, HSI oscillator characteristics): as much as a serial line takes, and more.

use embassy_stm32::Config;
use embassy_stm32::pac::RCC;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllSource, Sysclk,
};
use embassy_stm32::time::Hertz;

const CRYSTAL_HZ: Hertz = Hertz(8_000_000);

/// A thousandth of a second at the internal 16 MHz, from which the chip starts.
const MS: u32 = 16_000;

/// A crystal starts within 2 ms (DS8626, HSE oscillator characteristics: typical). ST's HAL waits 100 ms for it.
const PATIENCE_MS: u32 = 100;

/// Starts the crystal if possible, and returns the configuration for the HAL, which itself would wait for it forever.
pub(super) fn config() -> Config {
    let has_crystal = starts();
    let mut config = Config::default();
    // It stays on: the chip falls back to it if the crystal stops.
    config.rcc.hsi = true;
    config.rcc.hse = has_crystal.then_some(Hse {
        freq: CRYSTAL_HZ,
        mode: HseMode::Oscillator,
    });
    // 2 MHz into the PLL, at which it jitters least (RM0090, RCC_PLLCFGR.PLLM).
    let (source, divider) = if has_crystal {
        (PllSource::HSE, PllPreDiv::DIV4)
    } else {
        (PllSource::HSI, PllPreDiv::DIV8)
    };
    config.rcc.pll_src = source;
    config.rcc.pll = Some(Pll {
        prediv: divider,
        mul: PllMul::MUL168,
        divp: Some(PllPDiv::DIV2),
        divq: None,
        divr: None,
    });
    config.rcc.sys = Sysclk::PLL1_P;
    config.rcc.ahb_pre = AHBPrescaler::DIV1;
    config.rcc.apb1_pre = APBPrescaler::DIV4;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    config
}

fn starts() -> bool {
    RCC.cr().modify(|w| w.set_hseon(true));
    (0..PATIENCE_MS).any(|_| {
        let ready = is_ready();
        if !ready {
            cortex_m::asm::delay(MS);
        }
        ready
    })
}

fn is_ready() -> bool {
    RCC.cr().read().hserdy()
}

/// Watches a crystal that runs. If it stops, the chip goes on at 16 MHz, where each duty lasts ten times as long, and
/// raises the non-maskable interrupt (RM0090, clock security system): its handler turns the bridge off and starts anew.
pub(super) fn watch() {
    if is_ready() {
        RCC.cr().modify(|w| w.set_csson(true));
    }
}

/// Returns what is wrong with the clock.
pub(crate) fn clock_trouble() -> Option<&'static str> {
    (!is_ready()).then_some("Crystal does not start: the clock is less exact")
}
