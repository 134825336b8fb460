//! EXTI: interrupts on pin edges, lines 0 to 15 (RM0440, 16.5). The other lines' registers are as after a
//! reset.

use stm32_metapac::Interrupt;

use super::{Context, Part, Signal, Unmodelled};

/// The pins' lines.
const PINS: u32 = 0xffff;

/// IMR1 after a reset: the direct lines, from parts to the processor.
const DIRECT: u32 = 0x1f84_0000;

/// Interrupts and the lines that raise them.
const INTERRUPTS: [(Interrupt, u32); 7] = [
    (Interrupt::EXTI0, 1 << 0),
    (Interrupt::EXTI1, 1 << 1),
    (Interrupt::EXTI2, 1 << 2),
    (Interrupt::EXTI3, 1 << 3),
    (Interrupt::EXTI4, 1 << 4),
    (Interrupt::EXTI9_5, 0x03e0),
    (Interrupt::EXTI15_10, 0xfc00),
];

/// The part.
#[derive(Debug, Default)]
pub struct Exti {
    enabled: u32,
    rising: u32,
    falling: u32,
    pending: u32,
    levels: u32,
    up: u32,
}

impl Exti {
    /// Creates it as after a reset, with low pins.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes the level of the pin at a line, from 0 to 15.
    pub fn set_level(&mut self, line: u8, level: bool, context: &mut Context) {
        let bit = 1 << line;
        let edges = if level { self.rising } else { self.falling };
        if (self.levels & bit != 0) != level {
            self.levels ^= bit;
            self.pending |= bit & edges;
        }
        self.tell(context);
    }

    fn tell(&mut self, context: &mut Context) {
        let up = self.pending & self.enabled;
        for (interrupt, lines) in INTERRUPTS {
            let is_up = up & lines != 0;
            if is_up != (self.up & lines != 0) {
                let signal = Signal::Interrupt(interrupt as u16, is_up);
                context.signals.push(signal);
            }
        }
        self.up = up;
    }
}

impl Part for Exti {
    fn read(&mut self, offset: u32, _: &mut Context) -> Result<u32, Unmodelled> {
        match offset {
            0x00 => Ok(DIRECT | self.enabled),
            0x08 => Ok(self.rising),
            0x0c => Ok(self.falling),
            0x14 => Ok(self.pending),
            _ => Err(Unmodelled),
        }
    }

    fn write(&mut self, offset: u32, value: u32, context: &mut Context) -> Result<(), Unmodelled> {
        let others = if offset == 0 { DIRECT } else { 0 };
        if value & !PINS != others {
            return Err(Unmodelled);
        }
        let pins = value & PINS;
        match offset {
            0x00 => self.enabled = pins,
            0x08 => self.rising = pins,
            0x0c => self.falling = pins,
            0x14 => self.pending &= !pins,
            _ => return Err(Unmodelled),
        }
        self.tell(context);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_interrupts_until_it_is_acknowledged() {
        let mut exti = Exti::new();
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        exti.write(0x08, 1 << 12, &mut context).unwrap();
        exti.write(0x00, DIRECT | 1 << 12, &mut context).unwrap();
        exti.set_level(12, true, &mut context);
        exti.set_level(12, false, &mut context);
        exti.set_level(11, true, &mut context);
        assert_eq!(*context.signals, [Signal::Interrupt(40, true)]);
        assert_eq!(exti.read(0x14, &mut context), Ok(1 << 12));
        exti.write(0x14, 1 << 12, &mut context).unwrap();
        assert_eq!(context.signals[1..], [Signal::Interrupt(40, false)]);
    }
}
