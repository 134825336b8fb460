//! RCC: clocks, resets and their causes (RM0440, 7.4).
//!
//! Oscillators and the PLL are ready at once. The system clock is HSI or the PLL fed by it.

mod clock;
mod gates;

use stm32_metapac::rcc::regs::{Bdcr, Ccipr, Cfgr, Cr, Crrcr, Csr, Pllcfgr};
use stm32_metapac::rcc::vals::{Adcsel, Pllsrc, Ppre, Rtcsel, Sw, Uartsel, Usart1sel};

pub use clock::{ClockError, Supply};
use gates::Gates;

use super::{Cause, Context, Part, Unmodelled};
use crate::time::Cycles;

/// The part.
#[derive(Debug)]
pub struct Rcc {
    control: Cr,
    configuration: Cfgr,
    /// Since when the system has run from the PLL with the processor's clock divided.
    divided_since: Option<Cycles>,
    /// Whether the processor got the PLL's clock in one step.
    in_one_step: bool,
    pll: Pllcfgr,
    sources: Ccipr,
    gates: Gates,
    backup: Bdcr,
    backup_open: bool,
    status: Csr,
    usb: Crrcr,
}

impl Rcc {
    /// Creates it as at power-up.
    pub fn new() -> Self {
        let mut control = Cr(0);
        control.set_hsion(true);
        let mut configuration = Cfgr(0);
        configuration.set_sw(Sw::HSI);
        Self {
            control,
            configuration,
            divided_since: None,
            in_one_step: false,
            pll: Pllcfgr(0x1000),
            sources: Ccipr(0),
            gates: Gates::new(),
            backup: Bdcr(0),
            backup_open: false,
            status: flags(Cause::Power),
            usb: Crrcr(0),
        }
    }

    /// Resets it with the chip. The causes accumulate until the program clears them, and the backup domain
    /// keeps its registers, except after a loss of power.
    pub fn reset(&mut self, cause: Cause) {
        let (causes, backup) = match cause {
            Cause::Power => (Csr(0), Bdcr(0)),
            _ => (self.status, self.backup),
        };
        let mut kept = Csr(flags(cause).0 | causes.0);
        kept.set_lsion(false);
        kept.set_rmvf(false);
        *self = Self {
            status: kept,
            backup,
            ..Self::new()
        };
    }

    /// Makes the backup domain writable, or no longer: PWR's DBP.
    pub fn open_backup(&mut self, open: bool) {
        self.backup_open = open;
    }

    /// Returns whether the part at this address has a clock, or needs none.
    pub fn has_clock(&self, address: u32) -> bool {
        self.gates.open(address)
    }

    /// Returns the processor's clock in Hz with this core supply and these flash wait states.
    pub fn clock_hz(&self, supply: Supply) -> Result<u64, ClockError> {
        clock::frequency(self.configuration, self.pll, supply, self.in_one_step)
    }

    /// Returns the sources of the parts' own clocks.
    pub fn sources(&self) -> Ccipr {
        self.sources
    }

    fn write_control(&mut self, value: u32) -> Result<(), Unmodelled> {
        let asked = Cr(value);
        let mut wanted = Cr(0);
        wanted.set_hsion(asked.hsion());
        wanted.set_pllon(asked.pllon());
        let mut known = wanted;
        known.set_hsirdy(asked.hsirdy());
        known.set_pllrdy(asked.pllrdy());
        let on_pll = self.configuration.sw() == Sw::PLL1_R;
        let starts = wanted.pllon() && !self.control.pllon();
        // Everything runs from HSI; the PLL is not turned off while the system runs from it.
        if known.0 != value
            || !wanted.hsion()
            || on_pll && !wanted.pllon()
            || starts && self.pll.pllsrc() != Pllsrc::HSI
        {
            return Err(Unmodelled);
        }
        self.control = wanted;
        Ok(())
    }

    fn write_configuration(&mut self, value: u32, now: Cycles) -> Result<(), Unmodelled> {
        let asked = Cfgr(value);
        let mut wanted = Cfgr(0);
        wanted.set_sw(asked.sw());
        wanted.set_hpre(asked.hpre());
        let mut known = wanted;
        known.set_sws(asked.sws());
        let is_ready = match asked.sw() {
            Sw::HSI => true,
            Sw::PLL1_R => self.control.pllon() && self.pll.pllren(),
            _ => false,
        };
        // The parts run at the processor's clock.
        let undivided = asked.ppre1() == Ppre::DIV1 && asked.ppre2() == Ppre::DIV1;
        if known.0 != value || !undivided || !is_ready {
            return Err(Unmodelled);
        }
        let is_divided = clock::divider(wanted) > 1;
        if wanted.sw() != Sw::PLL1_R {
            (self.divided_since, self.in_one_step) = (None, false);
        } else if is_divided {
            self.divided_since.get_or_insert(now);
            self.in_one_step = false;
        } else {
            let long = |since| now - since >= clock::HALVED;
            self.in_one_step |= self.configuration.sw() != Sw::PLL1_R
                || self.divided_since.take().is_some_and(|since| !long(since));
        }
        self.configuration = wanted;
        Ok(())
    }

    fn write_pll(&mut self, value: u32) -> Result<(), Unmodelled> {
        if self.control.pllon() && value != self.pll.0 {
            return Err(Unmodelled);
        }
        self.pll = Pllcfgr(value);
        Ok(())
    }

    /// Serial lines from their bus or system clock, which are equal; the converters from the system clock.
    fn write_sources(&mut self, value: u32) -> Result<(), Unmodelled> {
        let asked = Ccipr(value);
        let mut wanted = Ccipr(0);
        wanted.set_adc12sel(asked.adc12sel());
        // The clock of USB and the random number generator, neither of which is modelled.
        wanted.set_clk48sel(asked.clk48sel());
        wanted.set_usart1sel(asked.usart1sel());
        wanted.set_usart2sel(asked.usart2sel());
        let first = matches!(asked.usart1sel(), Usart1sel::PCLK2 | Usart1sel::SYS);
        let second = matches!(asked.usart2sel(), Uartsel::PCLK1 | Uartsel::SYS);
        let converters = matches!(asked.adc12sel(), Adcsel::DISABLE | Adcsel::SYS);
        if value != wanted.0 || !(first && second && converters) {
            return Err(Unmodelled);
        }
        self.sources = wanted;
        Ok(())
    }

    fn write_backup(&mut self, value: u32) -> Result<(), Unmodelled> {
        let asked = Bdcr(value);
        if asked.bdrst() {
            self.backup = Bdcr(0);
            self.backup.set_bdrst(true);
            return Ok(());
        }
        let mut wanted = Bdcr(0);
        wanted.set_rtcsel(asked.rtcsel());
        wanted.set_rtcen(asked.rtcen());
        let known = matches!(asked.rtcsel(), Rtcsel::DISABLE | Rtcsel::LSI);
        if value != wanted.0 || !known {
            return Err(Unmodelled);
        }
        // The clock source can only be chosen once.
        if self.backup.rtcsel() != Rtcsel::DISABLE {
            wanted.set_rtcsel(self.backup.rtcsel());
        }
        self.backup = wanted;
        Ok(())
    }

    fn write_status(&mut self, value: u32) {
        let asked = Csr(value);
        if asked.rmvf() {
            self.status = Csr(0);
        }
        self.status.set_rmvf(asked.rmvf());
        self.status.set_lsion(asked.lsion());
    }
}

impl Default for Rcc {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns the flags that a reset leaves in CSR. The chip's own resets show at its reset pin too.
fn flags(cause: Cause) -> Csr {
    let mut flags = Csr(0);
    flags.set_pinrstf(true);
    match cause {
        Cause::Power => flags.set_borrstf(true),
        Cause::Software => flags.set_sftrstf(true),
        Cause::Watchdog => flags.set_iwdgrstf(true),
        Cause::Pin => {}
    }
    flags
}

impl Part for Rcc {
    fn read(&mut self, offset: u32, _: &mut Context) -> Result<u32, Unmodelled> {
        match offset {
            0x00 => {
                let mut value = self.control;
                value.set_hsirdy(value.hsion());
                value.set_pllrdy(value.pllon());
                Ok(value.0)
            }
            0x08 => {
                let mut value = self.configuration;
                value.set_sws(value.sw());
                Ok(value.0)
            }
            0x0c => Ok(self.pll.0),
            0x88 => Ok(self.sources.0),
            0x90 => Ok(self.backup.0),
            0x94 => {
                let mut value = self.status;
                value.set_lsirdy(value.lsion());
                Ok(value.0)
            }
            0x98 => {
                let mut value = self.usb;
                value.set_hsi48rdy(value.hsi48on());
                Ok(value.0)
            }
            _ => self.gates.read(offset),
        }
    }

    fn write(&mut self, offset: u32, value: u32, context: &mut Context) -> Result<(), Unmodelled> {
        match offset {
            0x00 => self.write_control(value),
            0x08 => self.write_configuration(value, context.now),
            0x0c => self.write_pll(value),
            0x88 => self.write_sources(value),
            0x90 if self.backup_open => self.write_backup(value),
            0x94 => {
                self.write_status(value);
                Ok(())
            }
            0x98 => {
                self.usb.set_hsi48on(Crrcr(value).hsi48on());
                Ok(())
            }
            _ => self.gates.write(offset, value, context),
        }
    }
}

#[cfg(test)]
mod tests;
