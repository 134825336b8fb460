//! DAC3, whose two channels only feed the comparators.

use stm32_metapac::dac::regs::{Cr, Mcr};
use stm32_metapac::dac::vals::Mode;

use super::{Context, Part, Unmodelled};

const CR: u32 = 0x00;
const DHR12R1: u32 = 0x08;
const DHR12R2: u32 = 0x14;
const DOR1: u32 = 0x2c;
const DOR2: u32 = 0x30;
const MCR: u32 = 0x3c;

/// The reference, V.
const SUPPLY_V: f64 = 3.3;

/// The converter: levels take effect when written, without its settling time.
#[derive(Clone, Debug, Default)]
pub struct Dac {
    control: Cr,
    mode: Mcr,
    levels: [u16; 2],
}

impl Dac {
    /// Creates it as after a reset.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the voltage of a channel, from 0; `None` while it is off.
    pub fn volts(&self, channel: usize) -> Option<f64> {
        let level = f64::from(self.levels[channel]);
        self.control.en(channel).then(|| level / 4096.0 * SUPPLY_V)
    }
}

impl Part for Dac {
    fn read(&mut self, offset: u32, _context: &mut Context) -> Result<u32, Unmodelled> {
        Ok(match offset {
            CR => self.control.0,
            DHR12R1 | DOR1 => self.levels[0].into(),
            DHR12R2 | DOR2 => self.levels[1].into(),
            MCR => self.mode.0,
            _ => return Err(Unmodelled),
        })
    }

    fn write(&mut self, offset: u32, value: u32, _context: &mut Context) -> Result<(), Unmodelled> {
        match offset {
            CR => {
                let (mut known, new) = (Cr(0), Cr(value));
                known.set_en(0, true);
                known.set_en(1, true);
                // Only the internal, unbuffered mode.
                let inside = |channel| self.mode.mode(channel) == Mode::NORMAL_INT_BUFDIS;
                let led = (0..2).all(|channel| !new.en(channel) || inside(channel));
                if value & !known.0 != 0 || !led {
                    return Err(Unmodelled);
                }
                self.control = new;
            }
            MCR => {
                let mut known = Mcr(0);
                known.set_mode(0, Mode::from_bits(7));
                known.set_mode(1, Mode::from_bits(7));
                known.set_hfsel(3);
                // A channel's mode may only be set while it is off (RM0440, DAC_MCR).
                if value & !known.0 != 0 || self.control.0 != 0 {
                    return Err(Unmodelled);
                }
                self.mode = Mcr(value);
            }
            DHR12R1 | DHR12R2 if value < 4096 => {
                self.levels[usize::from(offset == DHR12R2)] = value as u16;
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
    fn a_channel_has_its_level_while_it_is_on() {
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        let mut dac = Dac::new();
        let mut write = |dac: &mut Dac, offset, value| dac.write(offset, value, &mut context);
        // In its reset mode it would drive a pin.
        assert_eq!(write(&mut dac, CR, 1), Err(Unmodelled));
        // Internal for both channels, and a bus above 160 MHz.
        assert_eq!(write(&mut dac, MCR, 0x0003_0003 | 2 << 14), Ok(()));
        assert_eq!(write(&mut dac, DHR12R1, 1024), Ok(()));
        assert_eq!(write(&mut dac, DHR12R2, 4095), Ok(()));
        assert_eq!(dac.volts(0), None);
        assert_eq!(write(&mut dac, CR, 1), Ok(()));
        assert_eq!(dac.volts(0), Some(0.825));
        assert_eq!(dac.volts(1), None);
        assert_eq!(write(&mut dac, CR, 0x0001_0001), Ok(()));
        let top = dac.volts(1).expect("it is on");
        assert!((top - 3.2992).abs() < 1e-4);
        // Waves are not modelled.
        assert_eq!(write(&mut dac, CR, 0x0001_0001 | 1 << 6), Err(Unmodelled));
        assert_eq!(write(&mut dac, DHR12R1, 4096), Err(Unmodelled));
    }
}
