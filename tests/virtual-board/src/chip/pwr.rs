//! PWR: the core voltage, and the backup domain's lock (RM0440, 6.4).

use stm32_metapac::pwr::regs::{Cr1, Cr3};
use stm32_metapac::pwr::vals::Vos;

use super::{Context, Part, Unmodelled};

/// R1MODE in CR5: normal mode of voltage range 1, without boost. stm32-metapac 21.0.0 has it at bit 0;
/// RM0440 and ST's headers have it here.
const NORMAL_MODE: u32 = 1 << 8;

/// EIWUL in CR3: set after a reset.
const INTERNAL_WAKE_UP: u32 = 1 << 15;

/// The part.
#[derive(Debug)]
pub struct Pwr {
    control: Cr1,
    dead_battery: Cr3,
    range: u32,
}

impl Pwr {
    /// Creates it as after a reset: voltage range 1 without boost.
    pub fn new() -> Self {
        let mut control = Cr1(0);
        control.set_vos(Vos::RANGE1);
        Self {
            control,
            dead_battery: Cr3(INTERNAL_WAKE_UP),
            range: NORMAL_MODE,
        }
    }

    /// Returns whether range 1's boost is on, which clocks above 150 MHz need.
    pub fn boost(&self) -> bool {
        self.range & NORMAL_MODE == 0
    }

    /// Returns whether the backup domain's registers may be written.
    pub fn backup_open(&self) -> bool {
        self.control.dbp()
    }
}

impl Default for Pwr {
    fn default() -> Self {
        Self::new()
    }
}

impl Part for Pwr {
    fn read(&mut self, offset: u32, _: &mut Context) -> Result<u32, Unmodelled> {
        match offset {
            0x00 => Ok(self.control.0),
            0x08 => Ok(self.dead_battery.0),
            0x80 => Ok(self.range),
            _ => Err(Unmodelled),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _: &mut Context) -> Result<(), Unmodelled> {
        match offset {
            0x00 => {
                let mut wanted = Cr1(0);
                wanted.set_vos(Vos::RANGE1);
                wanted.set_dbp(Cr1(value).dbp());
                // Neither range 2 nor a low-power mode.
                if value != wanted.0 {
                    return Err(Unmodelled);
                }
                self.control = wanted;
            }
            0x08 => {
                // UCPD's dead-battery pulls at PB4 and PB6, which are not modelled.
                let mut others = Cr3(value);
                others.set_ucpd1_dbdis(false);
                if others.0 != INTERNAL_WAKE_UP {
                    return Err(Unmodelled);
                }
                self.dead_battery = Cr3(value);
            }
            0x80 => self.range = value & NORMAL_MODE,
            _ => return Err(Unmodelled),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boost_is_off_until_its_own_bit_is_cleared() {
        let mut pwr = Pwr::new();
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        assert!(!pwr.boost());
        assert_eq!(pwr.read(0x80, &mut context), Ok(0x100));
        pwr.write(0x80, 0x101, &mut context).unwrap();
        assert!(!pwr.boost());
        pwr.write(0x80, 0, &mut context).unwrap();
        assert!(pwr.boost());
    }

    #[test]
    fn the_backup_domain_opens_and_other_voltages_are_refused() {
        let mut pwr = Pwr::new();
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        assert_eq!(pwr.read(0, &mut context), Ok(0x200));
        pwr.write(0, 0x300, &mut context).unwrap();
        assert!(pwr.backup_open());
        assert_eq!(pwr.write(0, 0x400, &mut context), Err(Unmodelled));
        assert_eq!(pwr.write(0x08, 1, &mut context), Err(Unmodelled));
    }
}
