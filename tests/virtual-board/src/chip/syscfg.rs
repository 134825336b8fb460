//! SYSCFG: which ports' pins are at EXTI's lines, and what breaks TIM1 (RM0440, 10.2).

use stm32_metapac::syscfg::regs::{Cfgr2, Exticr};

use super::{Context, Part, Unmodelled};

/// CFGR1 after a reset: the floating-point unit's interrupts, except for an inexact result.
const CONFIGURATION: u32 = 0x7c00_0001;

/// The part.
#[derive(Debug)]
pub struct Syscfg {
    ports: [Exticr; 4],
    breaks: Cfgr2,
}

impl Syscfg {
    /// Creates it as after a reset.
    pub fn new() -> Self {
        Self {
            ports: [Exticr(0); 4],
            breaks: Cfgr2(0),
        }
    }

    /// Returns whether a processor lockup breaks TIM1's outputs.
    pub fn lock_up_breaks(&self) -> bool {
        self.breaks.cll()
    }

    /// Returns the port, 0 for A, whose pin is at this line of EXTI, from 0 to 15.
    pub fn port(&self, line: u8) -> u8 {
        let line = usize::from(line);
        self.ports[line / 4].exti(line % 4)
    }
}

impl Default for Syscfg {
    fn default() -> Self {
        Self::new()
    }
}

impl Part for Syscfg {
    fn read(&mut self, offset: u32, _: &mut Context) -> Result<u32, Unmodelled> {
        match offset {
            // The flash is at address 0.
            0x00 => Ok(0),
            0x04 => Ok(CONFIGURATION),
            0x08..=0x14 => Ok(self.ports[(offset as usize - 8) / 4].0),
            0x1c => Ok(self.breaks.0),
            _ => Err(Unmodelled),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _: &mut Context) -> Result<(), Unmodelled> {
        match offset {
            0x00 if value == 0 => {}
            0x04 if value == CONFIGURATION => {}
            0x08..=0x14 => self.ports[(offset as usize - 8) / 4] = Exticr(value & 0xffff),
            0x1c => {
                let mut wanted = Cfgr2(0);
                // Once set, it stays until a reset.
                wanted.set_cll(self.breaks.cll() || Cfgr2(value).cll());
                if value & !wanted.0 != 0 {
                    return Err(Unmodelled);
                }
                self.breaks = wanted;
            }
            _ => return Err(Unmodelled),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_break_on_lock_up_stays_once_it_is_set() {
        let mut part = Syscfg::new();
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        assert!(!part.lock_up_breaks());
        // The supply's and the memory's breaks are not modelled.
        assert_eq!(part.write(0x1c, 0b101, &mut context), Err(Unmodelled));
        assert!(!part.lock_up_breaks());
        part.write(0x1c, 1, &mut context).unwrap();
        part.write(0x1c, 0, &mut context).unwrap();
        assert!(part.lock_up_breaks());
        assert_eq!(part.read(0x1c, &mut context), Ok(1));
    }

    #[test]
    fn each_line_has_its_port() {
        let mut part = Syscfg::new();
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        part.write(0x14, 0x2010, &mut context).unwrap();
        assert_eq!([12, 13, 14, 15].map(|line| part.port(line)), [0, 1, 0, 2]);
        assert_eq!(part.port(3), 0);
    }
}
