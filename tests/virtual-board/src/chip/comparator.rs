//! COMP1, COMP2 and COMP4, each between a pin and a channel of DAC3.

use stm32_metapac::comp::regs::Csr;
use stm32_metapac::comp::vals::{Blanking, Hysteresis, Inm, Polarity};

use super::dac::Dac;
use super::{Context, Part, Unmodelled};

/// The modelled comparators, by number.
const NUMBERS: [u8; 3] = [1, 2, 4];

/// Their pins (port, number; port 0 is A) at INPSEL 0 and 1 (RM0440, comparators' plus inputs).
const PINS: [[(u8, u8); 2]; 3] = [[(0, 1), (1, 1)], [(0, 7), (0, 3)], [(1, 0), (4, 7)]];

/// DAC3's channels, from 0, at INMSEL 4 (RM0440, comparators' minus inputs).
const CHANNELS: [usize; 3] = [0, 1, 1];

/// What is wrong with a comparator.
#[derive(Clone, Copy, Debug, Default)]
pub enum Defect {
    /// Nothing.
    #[default]
    None,
    /// Its output is stuck at this level.
    Stuck(bool),
    /// It sees its pin this many volts higher.
    Offset(f64),
}

/// A comparator.
#[derive(Clone, Debug, Default)]
struct Comparator {
    control: Csr,
    output: bool,
    defect: Defect,
}

/// The comparators. Each has one register, COMP1's at 0.
#[derive(Clone, Debug, Default)]
pub struct Comparators {
    comparators: [Comparator; 3],
}

impl Comparators {
    /// Creates them as after a reset.
    pub fn new() -> Self {
        Self::default()
    }

    /// Resets them with the chip; a defect stays.
    pub(crate) fn reset(&mut self) {
        for comparator in &mut self.comparators {
            *comparator = Comparator {
                defect: comparator.defect,
                ..Comparator::default()
            };
        }
    }

    /// Gives a comparator, by number, a defect.
    pub(crate) fn set_defect(&mut self, number: u8, defect: Defect) {
        if let Some(which) = index(number) {
            self.comparators[which].defect = defect;
        }
    }

    /// Returns the pin (port, number; port 0 is A) at a comparator's plus input, by number, while it is on.
    pub fn pin(&self, number: u8) -> Option<(u8, u8)> {
        let which = index(number)?;
        let control = self.comparators[which].control;
        let pin = PINS[which][usize::from(control.inpsel())];
        control.en().then_some(pin)
    }

    /// Returns a comparator's output, by number, with this voltage at its plus input; without its delay of
    /// some 20 ns. Low while it is off.
    pub fn level(&mut self, number: u8, volts: f64, dac: &Dac) -> bool {
        let Some(which) = index(number) else {
            return false;
        };
        let comparator = &mut self.comparators[which];
        let control = comparator.control;
        // Without a level it floats, and does not trip.
        let level = dac.volts(CHANNELS[which]);
        let above = |volts| level.is_some_and(|level| volts > level);
        let inverted = control.polarity() == Polarity::INVERTED;
        let output = match comparator.defect {
            Defect::None => above(volts) != inverted,
            Defect::Offset(offset_v) => above(volts + offset_v) != inverted,
            Defect::Stuck(output) => output,
        };
        comparator.output = control.en() && output;
        comparator.output
    }
}

/// Returns a comparator's index among the modelled ones.
fn index(number: u8) -> Option<usize> {
    NUMBERS.iter().position(|which| *which == number)
}

/// Returns the comparator that has its register there.
fn at(offset: u32) -> Result<usize, Unmodelled> {
    let number = u8::try_from(offset / 4 + 1).map_err(|_| Unmodelled)?;
    index(number).ok_or(Unmodelled)
}

impl Part for Comparators {
    fn read(&mut self, offset: u32, _context: &mut Context) -> Result<u32, Unmodelled> {
        let comparator = &self.comparators[at(offset)?];
        let mut control = comparator.control;
        control.set_value(comparator.output);
        Ok(control.0)
    }

    fn write(&mut self, offset: u32, value: u32, _context: &mut Context) -> Result<(), Unmodelled> {
        let which = at(offset)?;
        let (mut known, new) = (Csr(0), Csr(value));
        known.set_en(true);
        known.set_inmsel(Inm::from_bits(7));
        known.set_inpsel(true);
        known.set_polarity(Polarity::INVERTED);
        // The output is read-only.
        known.set_value(true);
        let plain = new.hyst() == Hysteresis::NONE && new.blanksel() == Blanking::NO_BLANKING;
        let led = !new.en() || new.inmsel() == Inm::DACA;
        if value & !known.0 != 0 || !plain || !led {
            return Err(Unmodelled);
        }
        self.comparators[which].control = new;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board;

    fn set_up(levels: [u32; 2]) -> (Comparators, Dac) {
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        let (mut comparators, mut dac) = (Comparators::new(), Dac::new());
        for (offset, value) in [
            (0x3c, 0x0003_0003),
            (0x08, levels[0]),
            (0x14, levels[1]),
            (0x00, 0x0001_0001),
        ] {
            dac.write(offset, value, &mut context).expect("modelled");
        }
        for offset in [0, 4, 12] {
            comparators
                .write(offset, 4 << 4 | 1, &mut context)
                .expect("modelled");
        }
        (comparators, dac)
    }

    #[test]
    fn each_has_its_pin_and_its_channel() {
        let (mut comparators, dac) = set_up([1000, 2000]);
        assert_eq!(comparators.pin(1), Some((0, 1)));
        assert_eq!(comparators.pin(2), Some((0, 7)));
        assert_eq!(comparators.pin(4), Some((1, 0)));
        assert_eq!(comparators.pin(3), None);
        // Midway: above the first channel, below the second.
        let volts = 1500.0 / 4096.0 * 3.3;
        let levels = [1, 2, 4].map(|number| comparators.level(number, volts, &dac));
        assert_eq!(levels, [true, false, false]);
        let levels = [1, 2, 4].map(|number| comparators.level(number, 1.7, &dac));
        assert_eq!(levels, [true; 3]);
    }

    /// 40 A out of the motor: 128.57 mV plus 40 A times 3 mΩ times 4/7 is 197.1 mV, or 244.7 steps of the
    /// DAC; a step is 0.47 A.
    #[test]
    fn they_trip_at_the_rating() {
        let (mut comparators, dac) = set_up([244; 2]);
        for (number, leg) in [(1, 0), (2, 1), (4, 2)] {
            let mut trips = |current: f64| {
                let mut outside = board::Outside::default();
                outside.shunts_a[leg] = current;
                let pin = comparators.pin(number).expect("it is on");
                let volts = outside.volts(pin).expect("the board has the pin");
                comparators.level(number, volts, &dac)
            };
            assert!(!trips(0.0));
            assert!(!trips(39.5), "comparator {number}");
            assert!(trips(40.0), "comparator {number}");
            // It sees one sign only.
            assert!(!trips(-100.0));
        }
    }

    #[test]
    fn one_that_is_off_is_low_and_what_is_not_modelled_is_refused() {
        let (_, dac) = set_up([0; 2]);
        let mut comparators = Comparators::new();
        assert!(!comparators.level(1, 3.3, &dac));
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        // Hysteresis, the internal reference, and COMP3.
        for (offset, value) in [(0, 1 << 16 | 4 << 4 | 1), (0, 1), (8, 0)] {
            assert_eq!(
                comparators.write(offset, value, &mut context),
                Err(Unmodelled)
            );
        }
        // Inverted.
        let inverted = 1 << 15 | 4 << 4 | 1;
        assert_eq!(comparators.write(0, inverted, &mut context), Ok(()));
        assert!(!comparators.level(1, 3.3, &dac));
        assert!(comparators.level(1, -0.1, &dac));
        assert_eq!(comparators.read(0, &mut context), Ok(inverted | 1 << 30));
    }
}
