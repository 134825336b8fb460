//! All parts of the chip, each at its address (RM0440, 2.2.2).

use std::mem;

use super::adc::Converters;
use super::advanced_timer::AdvancedTimer;
use super::comparator::Comparators;
use super::dac::Dac;
use super::debug::Debug;
use super::dma::Dma;
use super::dmamux::DmaMux;
use super::exti::Exti;
use super::flash::Flash;
use super::gpio::Port;
use super::opamp::OpAmps;
use super::pwr::Pwr;
use super::rcc::Rcc;
use super::syscfg::Syscfg;
use super::timer::Timer;
use super::usart::Usart;
use super::watchdog::Watchdog;
use super::{Cause, Context, Part};
use crate::memory::Memory;
use crate::time::Cycles;

/// Ports A, B, C and the rest, up to G.
const PORTS: u8 = 7;

/// Where the ports begin, and the bytes that each takes.
const PORTS_AT: u32 = 0x4800_0000;
const PORT_BYTES: u32 = 0x400;

/// The chip.
pub struct Parts {
    pub(crate) tim1: AdvancedTimer,
    pub(crate) tim2: Timer,
    pub(crate) tim3: Timer,
    pub(crate) tim4: Timer,
    pub(crate) usart1: Usart,
    pub(crate) usart2: Usart,
    pub(crate) converters: Converters,
    pub(crate) watchdog: Watchdog,
    pub(crate) flash: Flash,
    pub(crate) rcc: Rcc,
    pub(crate) pwr: Pwr,
    pub(crate) syscfg: Syscfg,
    pub(crate) comparators: Comparators,
    pub(crate) op_amps: OpAmps,
    pub(crate) dac: Dac,
    pub(crate) dma: Dma,
    pub(crate) mux: DmaMux,
    pub(crate) ports: Vec<Port>,
    exti: Exti,
    pub(crate) debug: Debug,
}

impl Parts {
    /// Creates them as at power-up, with this flash.
    pub fn new(flash: Flash) -> Self {
        Self {
            tim1: AdvancedTimer::new(),
            tim2: Timer::tim2(),
            tim3: Timer::tim3(),
            tim4: Timer::tim4(),
            usart1: Usart::first(),
            usart2: Usart::second(),
            converters: Converters::new(),
            watchdog: Watchdog::new(),
            flash,
            rcc: Rcc::new(),
            pwr: Pwr::new(),
            syscfg: Syscfg::new(),
            comparators: Comparators::new(),
            op_amps: OpAmps::new(),
            dac: Dac::new(),
            dma: Dma::new(),
            mux: DmaMux::new(),
            ports: (0..PORTS).map(Port::new).collect(),
            exti: Exti::new(),
            debug: Debug::new(),
        }
    }

    /// Resets the chip: the flash keeps its bytes, and the backup domain and the reset flags keep theirs.
    pub fn reset(&mut self, cause: Cause, context: &mut Context) {
        // The time seeds what a power loss leaves of a word.
        self.flash.reset(context.now, context);
        self.rcc.reset(cause);
        let empty = Flash::new(Memory::new(0, 0, 0), 0..0);
        let flash = mem::replace(&mut self.flash, empty);
        let rcc = mem::take(&mut self.rcc);
        let mut comparators = mem::take(&mut self.comparators);
        comparators.reset();
        *self = Self {
            rcc,
            comparators,
            ..Self::new(flash)
        };
    }

    /// Returns the part whose registers hold an address, with the offset there.
    pub(crate) fn at(&mut self, address: u32) -> Option<(&mut dyn Part, u32)> {
        if (PORTS_AT..PORTS_AT + u32::from(PORTS) * PORT_BYTES).contains(&address) {
            let port = ((address - PORTS_AT) / PORT_BYTES) as usize;
            return Some((&mut self.ports[port], address % PORT_BYTES));
        }
        let (part, base): (&mut dyn Part, u32) = match address {
            0x4000_0000..0x4000_0400 => (&mut self.tim2, 0x4000_0000),
            0x4000_0400..0x4000_0800 => (&mut self.tim3, 0x4000_0400),
            0x4000_0800..0x4000_0c00 => (&mut self.tim4, 0x4000_0800),
            0x4000_3000..0x4000_3400 => (&mut self.watchdog, 0x4000_3000),
            0x4000_4400..0x4000_4800 => (&mut self.usart2, 0x4000_4400),
            0x4000_7000..0x4000_7400 => (&mut self.pwr, 0x4000_7000),
            0x4001_0000..0x4001_0030 => (&mut self.syscfg, 0x4001_0000),
            0x4001_0200..0x4001_0300 => (&mut self.comparators, 0x4001_0200),
            0x4001_0300..0x4001_0400 => (&mut self.op_amps, 0x4001_0300),
            0x4001_0400..0x4001_0800 => (&mut self.exti, 0x4001_0400),
            0x4001_2c00..0x4001_3000 => (&mut self.tim1, 0x4001_2c00),
            0x4001_3800..0x4001_3c00 => (&mut self.usart1, 0x4001_3800),
            0x4002_0000..0x4002_0400 => (&mut self.dma, 0x4002_0000),
            0x4002_0800..0x4002_0c00 => (&mut self.mux, 0x4002_0800),
            0x4002_1000..0x4002_1400 => (&mut self.rcc, 0x4002_1000),
            0x4002_2000..0x4002_2400 => (&mut self.flash, 0x4002_2000),
            0x5000_0000..0x5000_0400 => (&mut self.converters, 0x5000_0000),
            0x5000_1000..0x5000_1400 => (&mut self.dac, 0x5000_1000),
            0xe004_2000..0xe004_2400 => (&mut self.debug, 0xe004_2000),
            _ => return None,
        };
        Some((part, address - base))
    }

    /// Returns the DMA requests that stand until served.
    pub(crate) fn standing(&self) -> impl Iterator<Item = u8> {
        let lines = [&self.usart1, &self.usart2];
        let timers = [&self.tim2, &self.tim3, &self.tim4];
        let of_lines = lines.into_iter().flat_map(Usart::requests);
        of_lines.chain(timers.into_iter().flat_map(Timer::requests))
    }

    /// Notes that the DMA has served a request. A serial line need not be told: its data register was read
    /// or written.
    pub(crate) fn served(&mut self, number: u8) {
        for timer in [&mut self.tim2, &mut self.tim3, &mut self.tim4] {
            timer.served(number);
        }
    }

    /// Returns when any of them next does something by itself.
    pub(crate) fn due(&self) -> Cycles {
        let of_timers = self.tim1.due().min(self.tim2.due()).min(self.tim3.due());
        let of_lines = self.usart1.due().min(self.usart2.due());
        of_timers
            .min(self.tim4.due())
            .min(of_lines)
            .min(self.converters.due())
            .min(self.watchdog.due())
            .min(self.flash.due())
    }

    /// Lets those act that are due.
    pub(crate) fn act(&mut self, context: &mut Context) {
        let mut act = |part: &mut dyn Part| {
            if part.due() <= context.now {
                part.act(context);
            }
        };
        act(&mut self.tim1);
        act(&mut self.converters);
        act(&mut self.tim2);
        act(&mut self.tim3);
        act(&mut self.tim4);
        act(&mut self.usart1);
        act(&mut self.usart2);
        act(&mut self.watchdog);
        act(&mut self.flash);
    }
}
