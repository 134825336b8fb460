//! What the parts of the chip tell each other, and the bench.

use super::{CONVERTED, Event, World};
use crate::chip::dma::Transfer;
use crate::chip::{Context, Signal};
use crate::processor::{BusError, Width};

/// The throttle wire's pin: PA15, with TIM2's first channel.
const WIRE: (u8, u8) = (0, 15);
const WIRE_FUNCTION: u8 = 1;

/// Mask of the number in the set-point word, which differs in each.
const NUMBER_MASK: u32 = 0x1f00_0000;

impl World {
    /// Handles all signals, and those that follow from them.
    pub(super) fn deal(&mut self) {
        let mut at = 0;
        while let Some(signal) = self.signals.get(at) {
            let signal = *signal;
            at += 1;
            self.take(signal);
        }
        self.signals.clear();
    }

    fn take(&mut self, signal: Signal) {
        match signal {
            Signal::Interrupt(number, up) => {
                self.lines.set(number, up);
                if number == CONVERTED && up {
                    self.load.asked(self.now);
                }
            }
            Signal::NonMaskable(up) => self.lines.non_maskable = up,
            Signal::Request(number) => self.request(number),
            Signal::Trigger => self.trigger(),
            Signal::Gates { leg, high, low } => self.gates(leg, high, low),
            Signal::Sample { converter, channel } => self.sample(converter, channel),
            Signal::Pin { port, pin, level } => {
                if (port, pin) == WIRE {
                    self.drive(level);
                }
            }
            Signal::Sent { usart, byte } => self.happened.push(Event::Byte(self.now, usart, byte)),
            Signal::ResetPart(register, bit) => self.reset_part(register, bit),
            Signal::Reset(cause) => {
                self.reset.get_or_insert(cause);
            }
        }
    }

    /// Handles a part's request to move a datum. A request that finds its channel off, or all of its data
    /// moved, stands until the channel is turned on again.
    fn request(&mut self, number: u8) {
        let channel = self.parts.mux.channel(number);
        let Some(transfer) = channel.and_then(|channel| self.parts.dma.request(channel)) else {
            return;
        };
        self.parts.served(number);
        let moved = self.fetch(&transfer);
        let moved = moved.and_then(|datum| self.put(&transfer, datum));
        if moved.is_err() {
            self.fail(&format_args!(
                "the DMA's channel {} moves from {:#010x} to {:#010x}, where nothing is modelled",
                transfer.channel + 1,
                transfer.from,
                transfer.to
            ));
        }
        let mut context = Context {
            now: self.now,
            signals: &mut self.signals,
        };
        self.parts.dma.done(transfer.channel, &mut context);
    }

    fn fetch(&mut self, transfer: &Transfer) -> Result<u32, BusError> {
        let (from, bytes) = (transfer.from, transfer.from_width.bytes());
        let mut memories = self.memories.iter();
        if let Some(memory) = memories.find(|memory| memory.holds(from, bytes)) {
            return Ok(memory.read(from, bytes));
        }
        let value = self.access(from, |part, offset, context| part.read(offset, context))?;
        Ok(match transfer.from_width {
            Width::Byte => value & 0xff,
            Width::Half => value & 0xffff,
            Width::Word => value,
        })
    }

    fn put(&mut self, transfer: &Transfer, datum: u32) -> Result<(), BusError> {
        let (to, bytes) = (transfer.to, transfer.to_width.bytes());
        let mut memories = self.memories.iter();
        if let Some(memory) = memories.find(|memory| memory.holds(to, bytes)) {
            memory.write(to, bytes, datum);
            return Ok(());
        }
        self.access(to, |part, offset, context| {
            part.write(offset, datum, context)
        })
    }

    /// Offers the standing requests to a channel that has been turned on.
    pub(super) fn offer_requests(&mut self) {
        // A request that already stood is not signalled again: the part signals the next ones.
        let ready = |number: &u8| {
            let channel = self.parts.mux.channel(*number);
            channel.is_some_and(|channel| self.parts.dma.request(channel).is_some())
        };
        let offered: Vec<u8> = self.parts.standing().filter(ready).collect();
        for number in offered {
            self.request(number);
        }
    }

    /// Changes the wire's level.
    pub(super) fn edge(&mut self) {
        let Some(level) = self.throttle.take_edge() else {
            return;
        };
        if self.throttle.is_whole() {
            self.load.frame(self.now);
        }
        let (port, pin) = WIRE;
        let port = &mut self.parts.ports[usize::from(port)];
        port.set_input(pin, Some(level));
        // What the chip drives itself, it does not capture.
        if port.alternate(pin) == Some(WIRE_FUNCTION) {
            self.happened.push(Event::Edge(self.now, level));
            self.capture(level);
        }
    }

    fn capture(&mut self, level: bool) {
        let mut context = Context {
            now: self.now,
            signals: &mut self.signals,
        };
        self.parts.tim2.pin(level, &mut context);
    }

    /// Lets the chip drive the wire, or release it.
    fn drive(&mut self, level: Option<bool>) {
        if let Some(level) = level {
            self.happened.push(Event::Edge(self.now, level));
        }
        if let Some(reply) = self.throttle.drive(self.now, level) {
            self.happened.push(Event::Reply(reply));
        }
    }

    /// Starts a control period with the set-point that the tasks have left.
    pub(super) fn hear(&mut self) {
        let Some(address) = self.setpoint_at else {
            return;
        };
        let mut memories = self.memories.iter();
        if let Some(memory) = memories.find(|memory| memory.holds(address, 4)) {
            self.load.setpoint(memory.read(address, 4) & !NUMBER_MASK);
        }
    }

    fn reset_part(&mut self, register: u32, bit: u8) {
        let mut context = Context {
            now: self.now,
            signals: &mut self.signals,
        };
        let parts = &mut self.parts;
        match (register, bit) {
            (0x38, 0) => parts.tim2.reset(&mut context),
            (0x38, 1) => parts.tim3.reset(&mut context),
            (0x38, 2) => parts.tim4.reset(&mut context),
            (0x38, 17) => parts.usart2.reset(&mut context),
            (0x38, 28) => parts.pwr = crate::chip::pwr::Pwr::new(),
            (0x40, 0) => {
                parts.syscfg = crate::chip::syscfg::Syscfg::new();
                parts.comparators.reset();
                parts.op_amps = crate::chip::opamp::OpAmps::new();
            }
            (0x40, 11) => parts.tim1.reset(&mut context),
            (0x40, 14) => parts.usart1.reset(&mut context),
            (0x28, 0) => parts.dma = crate::chip::dma::Dma::new(),
            // The second DMA is not modelled, and not used.
            (0x28, 1) => {}
            (0x28, 8) => parts.flash.reset(self.now, &mut context),
            (0x28, 2) => parts.mux = crate::chip::dmamux::DmaMux::new(),
            (0x2c, bit @ 0..7) => parts.ports[usize::from(bit)].reset(&mut context),
            (0x2c, 13) => parts.converters.reset(&mut context),
            (0x2c, 18) => parts.dac = crate::chip::dac::Dac::new(),
            _ => self.fail(&format_args!(
                "the reset by bit {bit} of RCC's register at {register:#04x} is not modelled"
            )),
        }
    }
}
