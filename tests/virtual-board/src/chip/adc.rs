//! ADC1 and ADC2 with their common registers, as far as the image uses them.
//!
//! Each converts up to four injected ranks on TIM1's trigger output, and single regular conversions on the
//! program's request. The first one's registers are at 0, the second one's at 0x100, the common ones at
//! 0x300. Their kernel clock is the chip's (ADC12SEL in RCC's CCIPR), divided by the common prescaler.

mod converter;
#[cfg(test)]
mod tests;

use stm32_metapac::adccommon::regs::Ccr;
use stm32_metapac::adccommon::vals::{Ckmode, Presc};

use self::converter::Converter;
use super::{Context, Part, Signal, Unmodelled};
use crate::time::Cycles;

/// The common status register.
const CSR: u32 = 0x300;
/// The common control register.
const CCR: u32 = 0x308;

/// The interrupt of both, in the vector table.
const INTERRUPT: u16 = 18;

/// A converter's fastest clock is 60 MHz (data sheet), a third of the chip's.
const LEAST_RATIO: Cycles = 3;

/// Both converters.
#[derive(Clone, Debug, Default)]
pub struct Converters {
    converters: [Converter; 2],
    common: Ccr,
    line: bool,
}

impl Converters {
    /// Creates both as after a reset.
    pub fn new() -> Self {
        Self::default()
    }

    /// Resets the block, as RCC does.
    pub fn reset(&mut self, context: &mut Context) {
        for converter in &mut self.converters {
            converter.reset();
        }
        self.common = Ccr::default();
        self.update(context);
    }

    /// Makes the first regular conversion after each injected sequence convert channel 0, which ES0431
    /// (2.5.8) says may happen.
    pub fn mislead(&mut self) {
        for converter in &mut self.converters {
            converter.mislead();
        }
    }

    /// Takes a rising edge of TIM1's trigger output.
    pub fn trigger(&mut self, context: &mut Context) {
        let Some(clock) = clock(self.common) else {
            return;
        };
        for converter in &mut self.converters {
            converter.trigger(clock, context.now);
        }
    }

    /// Takes the voltage at the channel that `converter` (1 or 2) has requested by [`Signal::Sample`].
    pub fn sampled(&mut self, converter: u8, volts: f64) {
        self.converters[usize::from(converter) - 1].sampled(volts);
    }

    /// Returns the results of the injected sequences, by rank.
    pub fn injected(&self) -> [[u16; 4]; 2] {
        [0, 1].map(|number: usize| self.converters[number].injected())
    }

    /// Returns the triggers that a converter (1 or 2) has ignored because it was still busy with the previous
    /// sequence.
    pub fn ignored(&self, converter: u8) -> u64 {
        self.converters[usize::from(converter) - 1].ignored()
    }

    /// Updates the interrupt line from the flags.
    fn update(&mut self, context: &mut Context) {
        let up = self.converters.iter().any(Converter::interrupts);
        if up != self.line {
            self.line = up;
            context.signals.push(Signal::Interrupt(INTERRUPT, up));
        }
    }

    fn set_common(&mut self, value: u32) -> Result<(), Unmodelled> {
        let mut known = Ccr(0);
        known.set_ckmode(Ckmode::from_bits(3));
        known.set_presc(Presc::from_bits(15));
        // The clock must not change while a converter is on (RM0440, ADC_CCR).
        let on = self.converters.iter().any(Converter::on);
        if value & !known.0 != 0 || on && value != self.common.0 {
            return Err(Unmodelled);
        }
        self.common = Ccr(value);
        Ok(())
    }
}

impl Part for Converters {
    fn read(&mut self, offset: u32, context: &mut Context) -> Result<u32, Unmodelled> {
        let value = match offset {
            CSR => self.converters[0].flags() | self.converters[1].flags() << 16,
            CCR => self.common.0,
            0..CSR => self
                .converters
                .get_mut(offset as usize / 0x100)
                .ok_or(Unmodelled)?
                .read(offset % 0x100)?,
            _ => return Err(Unmodelled),
        };
        self.update(context);
        Ok(value)
    }

    fn write(&mut self, offset: u32, value: u32, context: &mut Context) -> Result<(), Unmodelled> {
        match offset {
            CCR => self.set_common(value)?,
            0..CSR => self
                .converters
                .get_mut(offset as usize / 0x100)
                .ok_or(Unmodelled)?
                .write(offset % 0x100, value, clock(self.common), context.now)?,
            _ => return Err(Unmodelled),
        }
        self.update(context);
        Ok(())
    }

    fn due(&self) -> Cycles {
        self.converters[0].due().min(self.converters[1].due())
    }

    fn act(&mut self, context: &mut Context) {
        let Some(clock) = clock(self.common) else {
            return;
        };
        for (converter, number) in self.converters.iter_mut().zip(1..) {
            if let Some(channel) = converter.act(clock, context.now) {
                let converter = number;
                context.signals.push(Signal::Sample { converter, channel });
            }
        }
        self.update(context);
    }
}

/// Returns the chip's clock cycles per half converter clock; `None` if that is too fast for the converters.
fn clock(common: Ccr) -> Option<Cycles> {
    let ratio = match (common.ckmode(), common.presc().to_bits()) {
        (Ckmode::ASYNCHRONOUS, 0) | (Ckmode::SYNC_DIV1, _) => 1,
        (Ckmode::ASYNCHRONOUS, by @ 1..=6) => 2 * Cycles::from(by),
        (Ckmode::ASYNCHRONOUS, by @ 7..=11) => 1 << (by - 3),
        (Ckmode::SYNC_DIV2, _) => 2,
        (Ckmode::SYNC_DIV4, _) => 4,
        (Ckmode::ASYNCHRONOUS, _) => return None,
    };
    (ratio >= LEAST_RATIO).then_some(ratio / 2)
}
