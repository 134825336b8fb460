//! DMA1: moves data between parts and memory on their requests (RM0440, 12.6).
//!
//! The chip's owner asks for a channel's transfer, moves the datum, and reports that it is done. That takes
//! no time here, while on the chip it takes some ten bus cycles.

use stm32_metapac::Interrupt;
use stm32_metapac::bdma::regs::{Cr, Isr, Ndtr};
use stm32_metapac::bdma::vals::{Dir, Size};

use super::{Context, Part, Signal, Unmodelled};
use crate::processor::Width;

/// Channels on the STM32G431.
pub const CHANNELS: usize = 6;

/// Bytes of a channel's registers; the first channel's begin at 8.
const CHANNEL_BYTES: u32 = 20;

/// What may change while a channel is on: EN, TCIE, HTIE, TEIE, CIRC.
const CHANGES_ON: u32 = 0b10_1111;

/// A datum in transit. A wider source is truncated to its low bits, a narrower one is zero-extended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transfer {
    /// The channel, from 0.
    pub channel: usize,
    /// Source address.
    pub from: u32,
    /// Destination address.
    pub to: u32,
    /// Source width.
    pub from_width: Width,
    /// Destination width.
    pub to_width: Width,
}

/// A channel's registers and its progress.
#[derive(Clone, Copy, Debug)]
struct Channel {
    control: Cr,
    count: u16,
    left: u16,
    part: u32,
    memory: u32,
    line: bool,
}

impl Channel {
    const RESET: Self = Self {
        control: Cr(0),
        count: 0,
        left: 0,
        part: 0,
        memory: 0,
        line: false,
    };

    /// Returns the part's and the memory address for the next datum.
    fn addresses(&self) -> [u32; 2] {
        let control = self.control;
        let passed = u32::from(self.count - self.left);
        let after = |start: u32, moves, size| {
            let bytes = width(size).map_or(0, Width::bytes);
            start.wrapping_add(if moves { passed * bytes } else { 0 })
        };
        [
            after(self.part, control.pinc(), control.psize()),
            after(self.memory, control.minc(), control.msize()),
        ]
    }

    /// Returns whether it has begun and not ended.
    fn is_amidst(&self) -> bool {
        self.left != self.count
    }

    fn read(&self, register: u32) -> Result<u32, Unmodelled> {
        match register {
            0x00 => Ok(self.control.0),
            0x04 => Ok(self.left.into()),
            0x08 => Ok(self.part),
            0x0c => Ok(self.memory),
            _ => Err(Unmodelled),
        }
    }

    fn write(&mut self, register: u32, value: u32) -> Result<(), Unmodelled> {
        match register {
            0x00 => return self.control(Cr(value)),
            // The others must not be written while the channel is on.
            _ if self.control.en() => return Err(Unmodelled),
            0x04 => {
                self.count = Ndtr(value).ndt();
                self.left = self.count;
            }
            0x08 => self.part = value,
            0x0c => self.memory = value,
            _ => return Err(Unmodelled),
        }
        Ok(())
    }

    fn control(&mut self, wanted: Cr) -> Result<(), Unmodelled> {
        let stays_on = self.control.en() && wanted.en();
        let changes = wanted.0 ^ self.control.0;
        let starts = wanted.en() && !self.control.en();
        let sizes = [wanted.psize(), wanted.msize()];
        // How a transfer continues that was turned off midway is not specified.
        if wanted.0 >> 14 != 0
            || sizes.iter().any(|size| width(*size).is_none())
            || stays_on && changes & !CHANGES_ON != 0
            || starts && self.is_amidst()
        {
            return Err(Unmodelled);
        }
        self.control = wanted;
        Ok(())
    }
}

fn width(size: Size) -> Option<Width> {
    match size {
        Size::BITS8 => Some(Width::Byte),
        Size::BITS16 => Some(Width::Half),
        Size::BITS32 => Some(Width::Word),
        _ => None,
    }
}

/// The part.
#[derive(Debug)]
pub struct Dma {
    channels: [Channel; CHANNELS],
    flags: Isr,
}

impl Dma {
    /// Creates it as after a reset.
    pub fn new() -> Self {
        Self {
            channels: [Channel::RESET; CHANNELS],
            flags: Isr(0),
        }
    }

    /// Returns what a channel, from 0, moves on a request; `None` unless it is on and has data left. The
    /// request then stands until the channel is on.
    pub fn request(&self, channel: usize) -> Option<Transfer> {
        let registers = self.channels.get(channel)?;
        let control = registers.control;
        if !control.en() || registers.left == 0 {
            return None;
        }
        let [part, memory] = registers.addresses();
        let part = (part, width(control.psize())?);
        let memory = (memory, width(control.msize())?);
        let (from, to) = match control.dir() {
            Dir::FROM_PERIPHERAL => (part, memory),
            Dir::FROM_MEMORY => (memory, part),
        };
        Some(Transfer {
            channel,
            from: from.0,
            to: to.0,
            from_width: from.1,
            to_width: to.1,
        })
    }

    /// Notes that the datum of a channel's request has been moved.
    pub fn done(&mut self, channel: usize, context: &mut Context) {
        let registers = &mut self.channels[channel];
        registers.left = registers.left.saturating_sub(1);
        // Half, rounded down, but at least one.
        if registers.count - registers.left == (registers.count / 2).max(1) {
            self.flags.set_htif(channel, true);
        }
        if registers.left == 0 {
            self.flags.set_tcif(channel, true);
            if registers.control.circ() {
                registers.left = registers.count;
            }
        }
        self.tell(context);
    }

    fn tell(&mut self, context: &mut Context) {
        for (index, channel) in self.channels.iter_mut().enumerate() {
            // The enables TCIE, HTIE, TEIE have the bit positions of a channel's flags.
            let line = self.flags.0 >> (4 * index) & channel.control.0 & 0b1110 != 0;
            if line != channel.line {
                channel.line = line;
                let number = Interrupt::DMA1_CHANNEL1 as u16 + index as u16;
                context.signals.push(Signal::Interrupt(number, line));
            }
        }
    }

    /// Returns the flags with each channel's global flag.
    fn all_flags(&self) -> Isr {
        let mut flags = self.flags;
        for channel in 0..CHANNELS {
            flags.set_gif(channel, self.flags.0 >> (4 * channel) & 0b1110 != 0);
        }
        flags
    }

    /// Clears flags; a channel's global flag clears all of its flags.
    fn clear(&mut self, bits: Isr) {
        for channel in 0..CHANNELS {
            let mask = if bits.gif(channel) { 0b1111 } else { 0 };
            self.flags.0 &= !(mask << (4 * channel));
        }
        self.flags.0 &= !bits.0;
    }
}

impl Default for Dma {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns the channel and its register at an offset.
fn place(offset: u32) -> Result<(usize, u32), Unmodelled> {
    let offset = offset.checked_sub(8).ok_or(Unmodelled)?;
    let channel = (offset / CHANNEL_BYTES) as usize;
    let place = (channel, offset % CHANNEL_BYTES);
    (channel < CHANNELS).then_some(place).ok_or(Unmodelled)
}

impl Part for Dma {
    fn read(&mut self, offset: u32, _: &mut Context) -> Result<u32, Unmodelled> {
        if offset == 0 {
            return Ok(self.all_flags().0);
        }
        let (channel, register) = place(offset)?;
        self.channels[channel].read(register)
    }

    fn write(&mut self, offset: u32, value: u32, context: &mut Context) -> Result<(), Unmodelled> {
        if offset == 4 {
            self.clear(Isr(value));
        } else {
            let (channel, register) = place(offset)?;
            self.channels[channel].write(register, value)?;
        }
        self.tell(context);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
