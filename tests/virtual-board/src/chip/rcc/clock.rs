//! The processor's clock.

use stm32_metapac::rcc::regs::{Cfgr, Pllcfgr};
use stm32_metapac::rcc::vals::Sw;
use thiserror::Error;

use crate::time::Cycles;

/// HSI's frequency.
const HSI_HZ: u64 = 16_000_000;

/// Minimum and maximum PLL input frequency (DS12589, PLL characteristics).
const PLL_IN_HZ: [u64; 2] = [2_660_000, 16_000_000];

/// Minimum and maximum frequency of the PLL's oscillator.
const OSCILLATOR_HZ: [u64; 2] = [96_000_000, 344_000_000];

/// Maximum core clock without PWR's boost.
const UNBOOSTED_HZ: u64 = 150_000_000;

/// How long a faster one must have been halved, in cycles at 170 MHz: 1 µs (RM0440, 6.1.5).
pub(super) const HALVED: Cycles = 170;

/// What a clock's limits depend on.
#[derive(Clone, Copy, Debug)]
pub struct Supply {
    /// Whether PWR's boost of voltage range 1 is on.
    pub boost: bool,
    /// The flash's wait states.
    pub wait_states: u8,
}

/// Why the chip may not run reliably like this.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum ClockError {
    /// The PLL's own limits.
    #[error("the PLL gets {input_hz} Hz and its oscillator {oscillator_hz} Hz: out of its range")]
    Pll {
        /// Its input.
        input_hz: u64,
        /// Its oscillator's frequency.
        oscillator_hz: u64,
    },
    /// The core's limit.
    #[error(
        "the core has {clock_hz} Hz, more than {greatest_hz} Hz of its voltage (PWR_CR5.R1MODE)"
    )]
    Core {
        /// The clock.
        clock_hz: u64,
        /// The maximum.
        greatest_hz: u64,
    },
    /// The core's supply gets no time to settle.
    #[error(
        "the core comes to {clock_hz} Hz in one step: above 150 MHz it wants half of it for 1 us first"
    )]
    Step {
        /// The clock.
        clock_hz: u64,
    },
    /// The flash's limit.
    #[error(
        "the flash is read at {clock_hz} Hz with {wait_states} wait states instead of {needed}"
    )]
    Flash {
        /// The clock.
        clock_hz: u64,
        /// As set.
        wait_states: u8,
        /// As needed.
        needed: u64,
    },
}

/// Returns the processor's clock in Hz.
pub(super) fn frequency(
    configuration: Cfgr,
    pll: Pllcfgr,
    supply: Supply,
    in_one_step: bool,
) -> Result<u64, ClockError> {
    let system_hz = match configuration.sw() {
        Sw::PLL1_R => pll_hz(pll)?,
        _ => HSI_HZ,
    };
    // RM0440, tables of voltage ranges and flash wait states.
    let (greatest_hz, step_hz) = if supply.boost {
        (170_000_000, 34_000_000)
    } else {
        (UNBOOSTED_HZ, 30_000_000)
    };
    if system_hz > greatest_hz {
        return Err(ClockError::Core {
            clock_hz: system_hz,
            greatest_hz,
        });
    }
    let clock_hz = system_hz / divider(configuration);
    if in_one_step && clock_hz > UNBOOSTED_HZ {
        return Err(ClockError::Step { clock_hz });
    }
    let needed = (clock_hz - 1) / step_hz;
    if u64::from(supply.wait_states) < needed {
        return Err(ClockError::Flash {
            clock_hz,
            wait_states: supply.wait_states,
            needed,
        });
    }
    Ok(clock_hz)
}

fn pll_hz(pll: Pllcfgr) -> Result<u64, ClockError> {
    let input_hz = HSI_HZ / (u64::from(pll.pllm().to_bits()) + 1);
    let oscillator_hz = input_hz * u64::from(pll.plln().to_bits());
    let within = |[least, greatest]: [u64; 2], hz| (least..=greatest).contains(&hz);
    if !within(PLL_IN_HZ, input_hz) || !within(OSCILLATOR_HZ, oscillator_hz) {
        return Err(ClockError::Pll {
            input_hz,
            oscillator_hz,
        });
    }
    Ok(oscillator_hz / (2 * (u64::from(pll.pllr().to_bits()) + 1)))
}

/// Returns AHB's prescaler: 2 to 16 from 8 on, then 64 to 512.
pub(super) fn divider(configuration: Cfgr) -> u64 {
    match configuration.hpre().to_bits() {
        bits @ 8..=11 => 2 << (bits - 8),
        bits @ 12.. => 64 << (bits - 12),
        _ => 1,
    }
}
