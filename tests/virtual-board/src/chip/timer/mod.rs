//! The general-purpose timers TIM2, TIM3 and TIM4 (RM0440): they count up, compare, and capture the edges
//! of one pin.
//!
//! Their clock is the chip's 170 MHz. The counter's start latency and the pin's synchronisation, a few
//! cycles, are neglected. A compare flag rises when the counter reaches the value: writing the current
//! count matches a turn later.

mod counter;
#[cfg(test)]
mod tests;

use stm32_metapac::Interrupt;
use stm32_metapac::timer::regs::{CcerGp16, CcmrInput2ch, Cr1Gp16, DierGp16, SrGp16};
use stm32_metapac::timer::vals::{CcmrInputCcs, Urs};

use self::counter::Counter;
use super::filter::Filter;
use super::timer_registers::{
    ARR, CCER, CCMR1, CCMR2, CCR1, CCR4, CNT, CR1, DIER, EGR, PSC, SR, channel, only,
};
use super::{Context, Part, Signal, Unmodelled};
use crate::time::{Cycles, NEVER};

/// Channels that may capture: the first two.
const CAPTURES: usize = 2;

/// Its DMA requests: the update's, then one per channel.
const REQUESTS: usize = 5;
const UPDATE: usize = 0;
const CHANNEL: usize = 1;

/// DIER's first request enable, UDE; those of the channels follow.
const REQUEST_ENABLES: u32 = 8;

/// CR1: CEN, URS, ARPE.
const CR1_BITS: u32 = 0x0085;
/// DIER: UIE, CCxIE, UDE, CCxDE.
const DIER_BITS: u32 = 0x1f1f;
/// SR: UIF, CCxIF.
const INTERRUPT_BITS: u32 = 0x001f;
/// CCMR1 for inputs: CCxS, ICxF; captures are not divided.
const CCMR1_BITS: u32 = 0xf3f3;
/// CCER: CCxE, CCxP of two channels.
const CCER_BITS: u32 = 0x0033;
/// EGR: UG.
const EGR_BITS: u32 = 0x0001;

/// What distinguishes the timers.
#[derive(Clone, Copy, Debug)]
struct Kind {
    /// Its counter's highest value.
    max: u32,
    /// Its interrupt.
    interrupt: Interrupt,
    /// The requests of its update and its channels at the DMA multiplexer (stm32-metapac's metadata for the
    /// STM32G431CB, from RM0440's table).
    requests: [u8; REQUESTS],
}

/// One of the timers.
pub struct Timer {
    kind: Kind,
    cr1: Cr1Gp16,
    dier: DierGp16,
    sr: SrGp16,
    ccmr1: CcmrInput2ch,
    ccer: CcerGp16,
    psc: u16,
    arr: u32,
    /// The value after which it overflows.
    top: u32,
    compares: [u32; 4],
    /// When the counter reaches each of them.
    matches: [Cycles; 4],
    counter: Counter,
    /// The pin's, as set for the first input; both channels are behind it.
    filter: Filter,
    /// Requests that the DMA has not served, one bit each.
    asks: u32,
    /// Whether the interrupt line is up.
    line: bool,
    due: Cycles,
}

impl Timer {
    /// Creates TIM2, with 32 bits.
    pub fn tim2() -> Self {
        Self::new(Kind {
            max: u32::MAX,
            interrupt: Interrupt::TIM2,
            requests: [60, 56, 57, 58, 59],
        })
    }

    /// Creates TIM3.
    pub fn tim3() -> Self {
        Self::new(Kind {
            max: 0xffff,
            interrupt: Interrupt::TIM3,
            requests: [65, 61, 62, 63, 64],
        })
    }

    /// Creates TIM4.
    pub fn tim4() -> Self {
        Self::new(Kind {
            max: 0xffff,
            interrupt: Interrupt::TIM4,
            requests: [71, 67, 68, 69, 70],
        })
    }

    fn new(kind: Kind) -> Self {
        Self {
            kind,
            cr1: Cr1Gp16(0),
            dier: DierGp16(0),
            sr: SrGp16(0),
            ccmr1: CcmrInput2ch(0),
            ccer: CcerGp16(0),
            psc: 0,
            arr: kind.max,
            top: kind.max,
            compares: [0; 4],
            matches: [NEVER; 4],
            counter: Counter::new(),
            filter: Filter::new(),
            asks: 0,
            line: false,
            due: NEVER,
        }
    }

    /// Resets it; the pin's level stays.
    pub fn reset(&mut self, context: &mut Context) {
        let (line, level) = (self.line, self.filter.level());
        *self = Self::new(self.kind);
        self.line = line;
        self.filter.input(level, context.now);
        self.settle(context);
    }

    /// Takes the level of the first channel's pin.
    pub fn pin(&mut self, level: bool, context: &mut Context) {
        self.catch_up(context);
        self.filter.input(level, context.now);
        self.settle(context);
    }

    /// Does what was due before an access at this time.
    fn catch_up(&mut self, context: &mut Context) {
        if self.due <= context.now {
            self.act(context);
        }
    }

    /// Returns whether a channel captures.
    fn captures(&self, channel: usize) -> bool {
        channel < CAPTURES && self.ccmr1.ccs(channel) != CcmrInputCcs::_RESERVED_0
    }

    /// Runs the counter if it is enabled; with a top of 0 it still stands.
    fn run(&mut self, now: Cycles) {
        self.counter.run(self.cr1.cen() && self.top > 0, now);
    }

    /// Handles an update event; `requests` tells whether it raises its flag.
    fn update(&mut self, requests: bool, now: Cycles, context: &mut Context) {
        self.top = self.arr;
        self.counter.restart(Cycles::from(self.psc) + 1, now);
        self.run(now);
        if requests {
            self.sr.set_uif(true);
            self.ask(UPDATE, context);
        }
    }

    /// Requests a DMA transfer, if enabled. The request stands until it is served or its enable is cleared.
    fn ask(&mut self, request: usize, context: &mut Context) {
        if self.dier.0 >> REQUEST_ENABLES >> request & 1 == 1 {
            self.asks |= 1 << request;
            let number = self.kind.requests[request];
            context.signals.push(Signal::Request(number));
        }
    }

    /// Returns the standing requests, by their numbers at the multiplexer.
    pub fn requests(&self) -> impl Iterator<Item = u8> + use<> {
        let (asks, numbers) = (self.asks, self.kind.requests);
        let stands = move |request: &usize| asks >> request & 1 == 1;
        (0..REQUESTS)
            .filter(stands)
            .map(move |request| numbers[request])
    }

    /// Notes that the DMA has served a request, if it is one of these.
    pub fn served(&mut self, number: u8) {
        let request = self.kind.requests.iter().position(|own| *own == number);
        self.asks &= !request.map_or(0, |request| 1 << request);
    }

    /// Raises the flag of a compare match or a capture.
    fn raise(&mut self, channel: usize, context: &mut Context) {
        self.sr.set_ccif(channel, true);
        self.ask(CHANNEL + channel, context);
    }

    fn capture(&mut self, context: &mut Context) {
        let level = self.filter.output();
        for channel in 0..CAPTURES {
            if self.captures(channel) && self.ccer.cce(channel) && self.ccer.ccp(channel) != level {
                if self.sr.ccif(channel) {
                    self.sr.set_ccof(channel, true);
                }
                self.compares[channel] = self.counter.count(context.now);
                self.raise(channel, context);
            }
        }
    }

    /// Restarts the counter from 0 by itself: a value above the top matches now.
    fn overflow(&mut self, at: Cycles, context: &mut Context) {
        let top = self.top;
        self.update(true, at, context);
        for channel in 0..4 {
            let compare = self.compares[channel];
            if !self.captures(channel) && (compare == 0 || compare > top) {
                self.raise(channel, context);
            }
        }
        self.expect(at);
    }

    /// Raises the matches up to this time.
    fn meet(&mut self, now: Cycles, context: &mut Context) {
        for channel in 0..4 {
            if self.matches[channel] <= now {
                self.matches[channel] = NEVER;
                self.raise(channel, context);
            }
        }
    }

    /// Finds when the counter reaches the compare values.
    fn expect(&mut self, now: Cycles) {
        for channel in 0..4 {
            let compare = self.compares[channel];
            self.matches[channel] = if self.captures(channel) || compare > self.top {
                NEVER
            } else {
                self.counter.arrival(compare, now)
            };
        }
    }

    /// Signals what has changed and finds what is due next.
    fn settle(&mut self, context: &mut Context) {
        if self.filter.act(context.now) {
            self.capture(context);
        }
        let line = self.sr.0 & self.dier.0 & INTERRUPT_BITS != 0;
        if line != self.line {
            self.line = line;
            let number = self.kind.interrupt as u16;
            context.signals.push(Signal::Interrupt(number, line));
        }
        let due = self
            .matches
            .iter()
            .fold(self.filter.due(), |due, at| due.min(*at));
        self.due = due.min(self.counter.overflow(self.top));
    }

    fn write_cr1(&mut self, value: u32, now: Cycles) -> Result<(), Unmodelled> {
        let new = Cr1Gp16(only(value, CR1_BITS)?);
        if !new.arpe() && self.top != self.arr {
            return Err(Unmodelled);
        }
        self.cr1 = new;
        self.run(now);
        Ok(())
    }

    fn write_ccmr1(&mut self, value: u32) -> Result<(), Unmodelled> {
        let new = CcmrInput2ch(only(value, CCMR1_BITS)?);
        // An input is the first pin or none; with none, the field's bits describe an output.
        let direct = match new.ccs(0) {
            CcmrInputCcs::TI4 => true,
            CcmrInputCcs::_RESERVED_0 => value & 0xff == 0,
            _ => false,
        };
        let crosswise = match new.ccs(1) {
            CcmrInputCcs::TI3 => true,
            CcmrInputCcs::_RESERVED_0 => value >> 8 == 0,
            _ => false,
        };
        if !direct || !crosswise {
            return Err(Unmodelled);
        }
        self.ccmr1 = new;
        self.filter.set(new.icf(0));
        Ok(())
    }

    fn write_arr(&mut self, value: u32, now: Cycles) -> Result<(), Unmodelled> {
        let passed = !self.cr1.arpe() && value < self.counter.count(now);
        if value > self.kind.max || passed {
            return Err(Unmodelled);
        }
        self.arr = value;
        if !self.cr1.arpe() {
            self.top = value;
            self.run(now);
        }
        Ok(())
    }
}

impl Part for Timer {
    fn read(&mut self, offset: u32, context: &mut Context) -> Result<u32, Unmodelled> {
        self.catch_up(context);
        Ok(match offset {
            CR1 => self.cr1.0,
            DIER => self.dier.0,
            SR => self.sr.0,
            CCMR1 => self.ccmr1.0,
            CCMR2 => 0,
            CCER => self.ccer.0,
            CNT => self.counter.count(context.now),
            PSC => self.psc.into(),
            ARR => self.arr,
            CCR1..=CCR4 => {
                let channel = channel(offset);
                if self.captures(channel) {
                    self.sr.set_ccif(channel, false);
                    self.settle(context);
                }
                self.compares[channel]
            }
            _ => return Err(Unmodelled),
        })
    }

    fn write(&mut self, offset: u32, value: u32, context: &mut Context) -> Result<(), Unmodelled> {
        self.catch_up(context);
        let now = context.now;
        match offset {
            CR1 => self.write_cr1(value, now)?,
            DIER => {
                self.dier = DierGp16(only(value, DIER_BITS)?);
                self.asks &= value >> REQUEST_ENABLES;
            }
            // Zeros clear.
            SR => self.sr.0 &= value,
            EGR => {
                if only(value, EGR_BITS)? != 0 {
                    let requests = self.cr1.urs() == Urs::ANY_EVENT;
                    self.update(requests, now, context);
                }
            }
            CCMR1 => self.write_ccmr1(value)?,
            CCMR2 => {
                only(value, 0)?;
            }
            CCER => self.ccer = CcerGp16(only(value, CCER_BITS)?),
            CNT if value <= self.top => self.counter.set(value, now),
            PSC => self.psc = u16::try_from(value).map_err(|_| Unmodelled)?,
            ARR => self.write_arr(value, now)?,
            CCR1..=CCR4 => {
                let channel = channel(offset);
                // A captured value cannot be written.
                if self.captures(channel) || value > self.kind.max {
                    return Err(Unmodelled);
                }
                self.compares[channel] = value;
            }
            _ => return Err(Unmodelled),
        }
        self.expect(now);
        self.settle(context);
        Ok(())
    }

    fn due(&self) -> Cycles {
        self.due
    }

    fn act(&mut self, context: &mut Context) {
        while let Some(at) = Some(self.counter.overflow(self.top)).filter(|at| *at <= context.now) {
            self.meet(at, context);
            self.overflow(at, context);
        }
        self.meet(context.now, context);
        self.settle(context);
    }
}
