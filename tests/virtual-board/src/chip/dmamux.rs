//! DMAMUX1: which request each of DMA1's channels serves (RM0440, 13.6). Without synchronisation and
//! request generators.

use stm32_metapac::dmamux::regs::Ccr;

use super::dma::CHANNELS;
use super::{Context, Part, Unmodelled};

/// The part.
#[derive(Debug)]
pub struct DmaMux {
    channels: [Ccr; CHANNELS],
}

impl DmaMux {
    /// Creates it as after a reset.
    pub fn new() -> Self {
        Self {
            channels: [Ccr(0); CHANNELS],
        }
    }

    /// Returns DMA1's channel, from 0, that serves a request (RM0440, table 91).
    pub fn channel(&self, request: u8) -> Option<usize> {
        self.channels
            .iter()
            .position(|channel| request != 0 && channel.dmareq_id() == request)
    }
}

impl Default for DmaMux {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns the channel of a register.
fn index(offset: u32) -> Result<usize, Unmodelled> {
    let index = offset as usize / 4;
    (index < CHANNELS).then_some(index).ok_or(Unmodelled)
}

impl Part for DmaMux {
    fn read(&mut self, offset: u32, _: &mut Context) -> Result<u32, Unmodelled> {
        Ok(self.channels[index(offset)?].0)
    }

    fn write(&mut self, offset: u32, value: u32, _: &mut Context) -> Result<(), Unmodelled> {
        let index = index(offset)?;
        let asked = Ccr(value);
        let request = asked.dmareq_id();
        let mut wanted = Ccr(0);
        wanted.set_dmareq_id(request);
        // An event after each transfer, which nothing uses.
        wanted.set_ege(asked.ege());
        // No two channels may have the same request.
        let is_others = self.channel(request).is_some_and(|other| other != index);
        if value != wanted.0 || is_others {
            return Err(Unmodelled);
        }
        self.channels[index] = wanted;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_reaches_its_channel() {
        let mut mux = DmaMux::new();
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        assert_eq!([0, 26, 56].map(|request| mux.channel(request)), [None; 3]);
        mux.write(0x00, 27, &mut context).unwrap();
        mux.write(0x14, 1 << 9 | 56, &mut context).unwrap();
        assert_eq!(
            [0, 27, 56].map(|request| mux.channel(request)),
            [None, Some(0), Some(5)]
        );
        assert_eq!(mux.read(0x14, &mut context), Ok(1 << 9 | 56));
        // Another channel's request, a synchronisation, DMA2's channels, a generator.
        for (offset, value) in [(0x04, 27), (0x04, 1 << 16 | 5), (0x20, 5), (0x100, 1)] {
            let written = mux.write(offset, value, &mut context);
            assert_eq!(written, Err(Unmodelled), "{offset:#x}");
        }
    }
}
