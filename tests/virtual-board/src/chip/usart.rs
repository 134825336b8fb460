//! USART1 and USART2: 8 data bits, no parity, one stop bit, oversampling by 16, with or without FIFOs, with
//! DMA and interrupts.

#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use stm32_metapac::usart::regs::{Cr1, Cr3, Icr, Isr, Rqr};

use super::{Context, Part, Signal, Unmodelled};
use crate::time::{CLOCK_HZ, Cycles, NEVER};

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const CR3: u32 = 0x08;
const BRR: u32 = 0x0c;
const RQR: u32 = 0x18;
const ISR: u32 = 0x1c;
const ICR: u32 = 0x20;
const RDR: u32 = 0x24;
const TDR: u32 = 0x28;
const PRESC: u32 = 0x2c;

/// Bits per byte on the line: start, data, stop. An idle frame is as long.
const FRAME_BITS: Cycles = 10;

/// Minimum divider of the clock with oversampling by 16.
const LEAST_DIVIDER: u32 = 16;

/// Bytes in each FIFO. The receiver's register holds one more (RM0440, RXFF).
const FIFO: usize = 8;

/// What distinguishes the two.
#[derive(Clone, Copy, Debug)]
struct Identity {
    number: u8,
    /// In the vector table.
    interrupt: u16,
    /// The receiver's and the transmitter's, at the DMA multiplexer.
    requests: [u8; 2],
}

/// A USART. Its clock is the chip's, undivided.
///
/// Each [`Signal::Request`] requests one transfer. It is sent when the need for one arises and after each
/// access to the data register that leaves it; a channel that is enabled later finds it by
/// [`Usart::requests`].
#[derive(Clone, Debug)]
pub struct Usart {
    identity: Identity,
    control: Cr1,
    transfers: Cr3,
    divider: u32,
    overrun: bool,
    idle: bool,
    complete: bool,
    /// Bytes to be sent, and the one being sent, until when.
    out: VecDeque<u8>,
    sending: Option<(u8, Cycles)>,
    /// The idle frame before the first byte.
    preamble_until: Cycles,
    /// Received bytes, and the register's last.
    received: VecDeque<u8>,
    last: u8,
    /// Bytes on the line, the first arriving at that time.
    coming: VecDeque<u8>,
    arrives: Cycles,
    idle_at: Cycles,
    line: bool,
    asked: [bool; 2],
}

impl Usart {
    /// Creates USART1 as after a reset.
    pub fn first() -> Self {
        Self::new(Identity {
            number: 1,
            interrupt: 37,
            requests: [24, 25],
        })
    }

    /// Creates USART2 as after a reset.
    pub fn second() -> Self {
        Self::new(Identity {
            number: 2,
            interrupt: 38,
            requests: [26, 27],
        })
    }

    fn new(identity: Identity) -> Self {
        Self {
            identity,
            control: Cr1(0),
            transfers: Cr3(0),
            divider: 0,
            overrun: false,
            idle: false,
            complete: true,
            out: VecDeque::new(),
            sending: None,
            preamble_until: 0,
            received: VecDeque::new(),
            last: 0,
            coming: VecDeque::new(),
            arrives: NEVER,
            idle_at: NEVER,
            line: false,
            asked: [false; 2],
        }
    }

    /// Resets it, as RCC does.
    pub fn reset(&mut self, context: &mut Context) {
        let line = self.line;
        *self = Self::new(self.identity);
        self.line = line;
        self.update(context);
    }

    /// Returns the line's bits per second; `None` while it is off.
    pub fn baud(&self) -> Option<f64> {
        let baud = CLOCK_HZ as f64 / f64::from(self.divider);
        self.control.ue().then_some(baud)
    }

    /// Puts bytes on the line from now on, without gaps, at the configured rate. A receiver that is off
    /// misses them.
    pub fn queue(&mut self, bytes: &[u8], now: Cycles) {
        if !self.receives() || bytes.is_empty() {
            return;
        }
        if self.coming.is_empty() {
            self.arrives = now + self.frame();
            self.idle_at = NEVER;
        }
        self.coming.extend(bytes);
    }

    /// Returns how many bytes wait on the line.
    pub fn waiting(&self) -> usize {
        self.coming.len()
    }

    /// Returns the DMA requests that are up, by their numbers at the multiplexer.
    pub fn requests(&self) -> impl Iterator<Item = u8> + use<> {
        let both = self.identity.requests.into_iter().zip(self.needs());
        both.filter_map(|(number, needed)| needed.then_some(number))
    }

    fn receives(&self) -> bool {
        self.control.ue() && self.control.re()
    }

    fn transmits(&self) -> bool {
        self.control.ue() && self.control.te()
    }

    fn frame(&self) -> Cycles {
        FRAME_BITS * Cycles::from(self.divider)
    }

    /// Returns its capacity in bytes: received, and to be sent.
    fn room(&self) -> [usize; 2] {
        if self.control.fifoen() {
            [FIFO + 1, FIFO]
        } else {
            [1, 1]
        }
    }

    fn takes_byte(&self) -> bool {
        self.out.len() < self.room()[1]
    }

    /// Returns whether the receiver and the transmitter need a transfer.
    fn needs(&self) -> [bool; 2] {
        [
            self.receives() && self.transfers.dmar() && !self.received.is_empty(),
            self.transmits() && self.transfers.dmat() && self.takes_byte(),
        ]
    }

    /// Returns ISR. The FIFOs' thresholds are not modelled.
    fn flags(&self) -> Isr {
        let mut flags = Isr(0);
        flags.set_ore(self.overrun);
        flags.set_idle(self.idle);
        flags.set_rxne(!self.received.is_empty());
        flags.set_tc(self.complete);
        flags.set_txe(self.takes_byte());
        flags.set_busy(!self.coming.is_empty());
        flags.set_teack(self.transmits());
        flags.set_reack(self.receives());
        if self.control.fifoen() {
            flags.set_txfe(self.out.is_empty());
            flags.set_rxff(self.received.len() == self.room()[0]);
        }
        flags
    }

    /// Updates the interrupt line and the requests from the flags.
    fn update(&mut self, context: &mut Context) {
        let (flags, control) = (self.flags(), self.control);
        let up = control.rxneie() && (flags.rxne() || flags.ore())
            || control.idleie() && flags.idle()
            || control.tcie() && flags.tc()
            || control.txeie() && flags.txe()
            || self.transfers.eie() && flags.ore();
        let up = up && control.ue();
        if up != self.line {
            self.line = up;
            let interrupt = self.identity.interrupt;
            context.signals.push(Signal::Interrupt(interrupt, up));
        }
        let needs = self.needs();
        for (which, number) in self.identity.requests.into_iter().enumerate() {
            if needs[which] && !self.asked[which] {
                context.signals.push(Signal::Request(number));
            }
        }
        self.asked = needs;
    }

    fn set_control(&mut self, value: u32, now: Cycles) -> Result<(), Unmodelled> {
        let (mut known, old, new) = (Cr1(0), self.control, Cr1(value));
        known.set_ue(true);
        known.set_re(true);
        known.set_te(true);
        known.set_idleie(true);
        known.set_rxneie(true);
        known.set_tcie(true);
        known.set_txeie(true);
        known.set_fifoen(true);
        let unfit = new.ue() && self.divider < LEAST_DIVIDER
            || old.ue() && new.ue() && old.fifoen() != new.fifoen()
            || new.ue() && !new.te() && self.sending.is_some();
        if value & !known.0 != 0 || unfit {
            return Err(Unmodelled);
        }
        let transmitted = self.transmits();
        self.control = new;
        if !new.ue() {
            self.give_up();
        }
        if !self.receives() {
            self.coming.clear();
            self.arrives = NEVER;
            self.idle_at = NEVER;
        }
        if self.transmits() && !transmitted {
            self.preamble_until = now + self.frame();
        }
        Ok(())
    }

    /// Drops what it was doing, and its flags, when disabled (RM0440, UE).
    fn give_up(&mut self) {
        self.overrun = false;
        self.idle = false;
        self.complete = true;
        self.out.clear();
        self.sending = None;
        self.received.clear();
    }

    fn set_transfers(&mut self, value: u32) -> Result<(), Unmodelled> {
        let mut known = Cr3(0);
        known.set_eie(true);
        known.set_dmar(true);
        known.set_dmat(true);
        if value & !known.0 != 0 {
            return Err(Unmodelled);
        }
        self.transfers = Cr3(value);
        Ok(())
    }

    /// Takes a byte to be sent. One too many, or one for a transmitter that is off, would be lost.
    fn send(&mut self, byte: u8, now: Cycles) -> Result<(), Unmodelled> {
        if !self.transmits() || !self.takes_byte() {
            return Err(Unmodelled);
        }
        self.complete = false;
        self.out.push_back(byte);
        self.asked[1] = false;
        self.load(now.max(self.preamble_until));
        Ok(())
    }

    /// Puts the next byte on the line if that is free.
    fn load(&mut self, from: Cycles) {
        if self.sending.is_none() {
            let end = from + self.frame();
            self.sending = self.out.pop_front().map(|byte| (byte, end));
        }
    }

    fn fetch(&mut self) -> u8 {
        if let Some(byte) = self.received.pop_front() {
            self.last = byte;
        }
        self.asked[0] = false;
        self.last
    }

    /// Takes the first byte on the line, which has arrived.
    fn arrive(&mut self) {
        let Some(byte) = self.coming.pop_front() else {
            return;
        };
        if self.received.len() < self.room()[0] {
            self.received.push_back(byte);
        } else {
            self.overrun = true;
        }
        let next = self.arrives + self.frame();
        (self.arrives, self.idle_at) = if self.coming.is_empty() {
            (NEVER, next)
        } else {
            (next, NEVER)
        };
    }
}

impl Part for Usart {
    fn read(&mut self, offset: u32, context: &mut Context) -> Result<u32, Unmodelled> {
        Ok(match offset {
            CR1 => self.control.0,
            CR2 | PRESC => 0,
            CR3 => self.transfers.0,
            BRR => self.divider,
            ISR => self.flags().0,
            RDR => {
                let byte = self.fetch();
                self.update(context);
                byte.into()
            }
            _ => return Err(Unmodelled),
        })
    }

    fn write(&mut self, offset: u32, value: u32, context: &mut Context) -> Result<(), Unmodelled> {
        match offset {
            CR1 => self.set_control(value, context.now)?,
            // One stop bit, no inversion, an undivided clock.
            CR2 | PRESC if value == 0 => {}
            CR3 => self.set_transfers(value)?,
            BRR if value == self.divider || !self.control.ue() && value <= 0xffff => {
                self.divider = value;
            }
            RQR => {
                let mut known = Rqr(0);
                known.set_rxfrq(true);
                if value & !known.0 != 0 {
                    return Err(Unmodelled);
                }
                if Rqr(value).rxfrq() {
                    self.received.clear();
                }
            }
            // The HAL writes all flags that it has read: the other bits mean nothing here.
            ICR => {
                let clear = Icr(value);
                self.overrun &= !clear.ore();
                self.idle &= !clear.idle();
                self.complete &= !clear.tc();
            }
            TDR => self.send(value as u8, context.now)?,
            _ => return Err(Unmodelled),
        }
        self.update(context);
        Ok(())
    }

    fn due(&self) -> Cycles {
        let sent = self.sending.map_or(NEVER, |(_, end)| end);
        sent.min(self.arrives).min(self.idle_at)
    }

    fn act(&mut self, context: &mut Context) {
        let now = context.now;
        if let Some((byte, end)) = self.sending.filter(|(_, end)| *end <= now) {
            let usart = self.identity.number;
            context.signals.push(Signal::Sent { usart, byte });
            self.sending = None;
            self.load(end);
            self.complete = self.sending.is_none();
        }
        if self.idle_at <= now {
            self.idle_at = NEVER;
            self.idle = true;
        }
        if self.arrives <= now {
            self.arrive();
        }
        self.update(context);
    }
}
