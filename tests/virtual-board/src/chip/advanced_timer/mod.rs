//! TIM1: centre-aligned PWM with complementary outputs, dead time and a break (RM0440, advanced-control
//! timers).
//!
//! Its clock is the chip's 170 MHz, undivided. The counter's start latency and the clock or two by which
//! the outputs lag it are neglected. Active levels are high and idle levels low; everything else is
//! refused.

mod channel;
mod leg;
mod ramp;
#[cfg(test)]
mod tests;

use stm32_metapac::timer::regs::{
    Af1Adv, BdtrAdv, CcerAdv, CcmrOutputGp16, Cr1Gp16, Cr2Adv, EgrAdv, SrAdv,
};
use stm32_metapac::timer::vals::{Bkp, Cms, Dir, Mms, Urs};

use self::channel::Channel;
use self::leg::{Enables, Leg, dead_time};
use self::ramp::Ramp;
use super::filter::Filter;
use super::timer_registers::{
    AF1, ARR, BDTR, CCER, CCMR1, CCMR2, CCR1, CCR4, CNT, CR1, CR2, DIER, EGR, PSC, RCR, SR,
    channel, only,
};
use super::{Context, Part, Signal, Unmodelled};
use crate::time::{Cycles, NEVER};

/// Legs of the bridge: channels 1 to 3.
const LEGS: usize = 3;

/// The channel, from 0, whose reference may be the trigger output.
const TRIGGERS: usize = 3;

/// CR1: CEN, URS, DIR, CMS, ARPE. The hardware sets the direction.
const CR1_BITS: u32 = 0x00f5;
/// CR2: CCPC, MMS.
const CR2_BITS: u32 = 0x0071;
/// EGR: UG, COMG.
const EGR_BITS: u32 = 0x0021;
/// CCMR: OCxPE and OCxM of two channels; of the latter, the bits of the modelled modes.
const CCMR_BITS: u32 = 0x7878;
/// CCER: CCxE of four channels, CCxNE of three.
const CCER_BITS: u32 = 0x1555;
/// BDTR: DTG, OSSI, OSSR, BKE, BKP, MOE, BKF.
const BDTR_BITS: u32 = 0x000f_bcff;
/// AF1: BKCMP1E, BKCMP2E, BKCMP4E.
const AF1_BITS: u32 = 0x0016;

/// The timer. Whatever waits for an update or a commutation is held twice.
pub struct AdvancedTimer {
    cr1: Cr1Gp16,
    cr2: Cr2Adv,
    sr: SrAdv,
    ccmr: [CcmrOutputGp16; 2],
    ccer: CcerAdv,
    bdtr: BdtrAdv,
    af1: Af1Adv,
    arr: u16,
    rcr: u16,
    /// Turns until the next update.
    repetitions: u16,
    ramp: Ramp,
    channels: [Channel; 4],
    enables: [Enables; LEGS],
    legs: [Leg; LEGS],
    filter: Filter,
    /// Level of the trigger output.
    trigger: bool,
    halted: bool,
    due: Cycles,
}

impl Default for AdvancedTimer {
    fn default() -> Self {
        Self::new()
    }
}

impl AdvancedTimer {
    /// Creates one as after a reset.
    pub fn new() -> Self {
        Self {
            cr1: Cr1Gp16(0),
            cr2: Cr2Adv(0),
            sr: SrAdv(0),
            ccmr: [CcmrOutputGp16(0); 2],
            ccer: CcerAdv(0),
            bdtr: BdtrAdv(0),
            // BKINE: the pin, which is not wired, breaks.
            af1: Af1Adv(1),
            arr: u16::MAX,
            rcr: 0,
            repetitions: 0,
            ramp: Ramp::new(),
            channels: [const { Channel::new() }; 4],
            enables: [Enables::default(); LEGS],
            legs: [const { Leg::new() }; LEGS],
            filter: Filter::new(),
            trigger: false,
            halted: false,
            due: NEVER,
        }
    }

    /// Resets it: its gates turn off, the break's level stays.
    pub fn reset(&mut self, context: &mut Context) {
        self.bdtr = BdtrAdv(0);
        self.settle(context);
        let level = self.filter.level();
        *self = Self::new();
        self.set_break(level, context);
    }

    /// Sets the level at the break input: that of the comparators that break.
    pub fn set_break(&mut self, level: bool, context: &mut Context) {
        self.catch_up(context);
        self.filter.input(level, context.now);
        self.settle(context);
    }

    /// Stops it with the processor: the outputs turn off as if MOE were cleared, but MOE stays (RM0440,
    /// debug mode). That its counter stops is not modelled: nothing observes it.
    pub fn halt(&mut self, context: &mut Context) {
        self.catch_up(context);
        self.halted = true;
        self.settle(context);
    }

    /// Returns which of the comparators 1, 2 and 4 break.
    pub fn break_comparators(&self) -> [bool; 3] {
        [0, 1, 3].map(|number| self.af1.bkcmpe(number))
    }

    /// Returns the compare values of channels 1 to 3, as written.
    pub fn compares(&self) -> [u16; LEGS] {
        [0, 1, 2].map(|number: usize| self.channels[number].written())
    }

    /// Returns the break flag and the main output enable.
    pub fn broken_and_on(&self) -> (bool, bool) {
        (self.sr.bif(0), self.bdtr.moe())
    }

    fn broken(&self) -> bool {
        let high = self.bdtr.bkp(0) == Bkp::ACTIVE_HIGH;
        self.bdtr.bke(0) && self.filter.output() == high
    }

    /// Does what was due before an access at this time.
    fn catch_up(&mut self, context: &mut Context) {
        if self.due <= context.now {
            self.act(context);
        }
    }

    /// Handles an update event.
    fn update(&mut self) {
        self.ramp.set_top(self.arr);
        self.repetitions = self.rcr;
        for channel in &mut self.channels {
            channel.update();
        }
    }

    /// Turns the counter around. Compare flags rise on the way down (CMS); with a value above the top, at
    /// the top.
    fn turn(&mut self) {
        self.ramp.turn();
        let (top, down) = (self.ramp.top(), self.ramp.down());
        for (number, channel) in self.channels.iter().enumerate() {
            let compare = Cycles::from(channel.compare());
            if (down && compare >= top) || (!down && compare == 0) {
                self.sr.set_ccif(number, true);
            }
        }
        if self.repetitions == 0 {
            self.update();
            self.sr.set_uif(true);
        } else {
            self.repetitions -= 1;
        }
    }

    /// Adopts modes and enable bits.
    fn commutate(&mut self) {
        for (number, channel) in self.channels.iter_mut().enumerate() {
            channel.set_mode(self.ccmr[number / 2].ocm(number % 2));
        }
        for (number, enables) in self.enables.iter_mut().enumerate() {
            enables.high = self.ccer.cce(number);
            enables.low = self.ccer.ccne(number);
        }
    }

    /// Brings everything up to date, signals what has changed and finds what is due next.
    fn settle(&mut self, context: &mut Context) {
        let now = context.now;
        self.filter.act(now);
        if self.broken() {
            self.bdtr.set_moe(false);
            self.sr.set_bif(0, true);
        }
        let mut due = self.ramp.due().min(self.filter.due());
        for (number, channel) in self.channels.iter_mut().enumerate() {
            let changes = channel.look(&self.ramp, now);
            let meets = self.ramp.count(now) == u32::from(channel.compare());
            if changes && meets && self.ramp.down() {
                self.sr.set_ccif(number, true);
            }
            due = due.min(channel.due(&self.ramp));
        }
        let dead_time = dead_time(self.bdtr.dtg());
        let main = self.bdtr.moe() && !self.halted;
        let legs = self.legs.iter_mut().zip(&self.channels).zip(&self.enables);
        for (leg, ((generator, channel), enables)) in legs.enumerate() {
            generator.follow(channel.reference(), dead_time, now);
            if generator.due() > now {
                due = due.min(generator.due());
            }
            if let Some([high, low]) = generator.drive(main, *enables, now) {
                context.signals.push(Signal::Gates { leg, high, low });
            }
        }
        let trigger = self.cr2.mms() == Mms::COMPARE_OC4 && self.channels[TRIGGERS].reference();
        if trigger && !self.trigger {
            context.signals.push(Signal::Trigger);
        }
        self.trigger = trigger;
        self.due = due;
    }

    fn write_cr1(&mut self, value: u32, now: Cycles) -> Result<(), Unmodelled> {
        let new = Cr1Gp16(only(value, CR1_BITS)?);
        let runs = self.cr1.cen();
        let changes_shape = new.cms() != self.cr1.cms();
        let shape = match new.cms() {
            Cms::CENTER_ALIGNED1 => true,
            Cms::EDGE_ALIGNED => !new.cen(),
            _ => false,
        };
        let waits = !new.arpe() && self.ramp.top() != Cycles::from(self.arr);
        if !shape || waits || (runs && changes_shape) {
            return Err(Unmodelled);
        }
        self.cr1 = new;
        if runs != new.cen() {
            self.ramp.run(new.cen(), now);
        }
        Ok(())
    }

    fn write_cr2(&mut self, value: u32) -> Result<(), Unmodelled> {
        let new = Cr2Adv(only(value, CR2_BITS)?);
        let triggers = matches!(new.mms(), Mms::RESET | Mms::COMPARE_OC4);
        // What becomes of waiting bits is unknown.
        if !triggers || (self.cr2.ccpc() && !new.ccpc()) {
            return Err(Unmodelled);
        }
        self.cr2 = new;
        Ok(())
    }

    fn write_egr(&mut self, value: u32, context: &mut Context) -> Result<(), Unmodelled> {
        let events = EgrAdv(only(value, EGR_BITS)?);
        if events.comg() {
            self.commutate();
            self.sr.set_comif(true);
        }
        if events.ug() {
            self.update();
            self.ramp.restart(context.now);
            if self.cr1.urs() == Urs::ANY_EVENT {
                self.sr.set_uif(true);
            }
            if self.cr2.mms() == Mms::RESET {
                context.signals.push(Signal::Trigger);
            }
        }
        Ok(())
    }

    fn write_ccmr(&mut self, index: usize, value: u32) -> Result<(), Unmodelled> {
        let new = CcmrOutputGp16(only(value, CCMR_BITS)?);
        if !(0..2).all(|channel| Channel::has(new.ocm(channel))) {
            return Err(Unmodelled);
        }
        self.ccmr[index] = new;
        for channel in 0..2 {
            self.channels[2 * index + channel].set_preloaded(new.ocpe(channel));
        }
        self.enable();
        Ok(())
    }

    /// Handles a write to modes or enable bits.
    fn enable(&mut self) {
        if !self.cr2.ccpc() {
            self.commutate();
        }
    }

    fn write_arr(&mut self, value: u32) -> Result<(), Unmodelled> {
        let new = u16::try_from(value).map_err(|_| Unmodelled)?;
        // It cannot count to 0.
        if new == 0 || (self.cr1.cen() && new != self.arr) {
            return Err(Unmodelled);
        }
        self.arr = new;
        if !self.cr1.arpe() {
            self.ramp.set_top(new);
        }
        Ok(())
    }

    fn write_bdtr(&mut self, value: u32) -> Result<(), Unmodelled> {
        self.bdtr = BdtrAdv(only(value, BDTR_BITS)?);
        self.filter.set(self.bdtr.bkf(0));
        Ok(())
    }
}

impl Part for AdvancedTimer {
    fn read(&mut self, offset: u32, context: &mut Context) -> Result<u32, Unmodelled> {
        self.catch_up(context);
        Ok(match offset {
            CR1 => {
                let mut cr1 = self.cr1;
                cr1.set_dir(if self.ramp.down() { Dir::DOWN } else { Dir::UP });
                cr1.0
            }
            CR2 => self.cr2.0,
            DIER | PSC => 0,
            SR => self.sr.0,
            CCMR1 => self.ccmr[0].0,
            CCMR2 => self.ccmr[1].0,
            CCER => self.ccer.0,
            CNT => self.ramp.count(context.now),
            ARR => self.arr.into(),
            RCR => self.rcr.into(),
            CCR1..=CCR4 => self.channels[channel(offset)].written().into(),
            BDTR => self.bdtr.0,
            AF1 => self.af1.0,
            _ => return Err(Unmodelled),
        })
    }

    fn write(&mut self, offset: u32, value: u32, context: &mut Context) -> Result<(), Unmodelled> {
        self.catch_up(context);
        match offset {
            CR1 => self.write_cr1(value, context.now)?,
            CR2 => self.write_cr2(value)?,
            // No interrupt, no request, no clock division.
            DIER | PSC => {
                only(value, 0)?;
            }
            // Zeros clear.
            SR => self.sr.0 &= value,
            EGR => self.write_egr(value, context)?,
            CCMR1 => self.write_ccmr(0, value)?,
            CCMR2 => self.write_ccmr(1, value)?,
            CCER => {
                self.ccer = CcerAdv(only(value, CCER_BITS)?);
                self.enable();
            }
            ARR => self.write_arr(value)?,
            RCR => self.rcr = u16::try_from(value).map_err(|_| Unmodelled)?,
            CCR1..=CCR4 => {
                let value = u16::try_from(value).map_err(|_| Unmodelled)?;
                self.channels[channel(offset)].write(value);
            }
            BDTR => self.write_bdtr(value)?,
            AF1 => self.af1 = Af1Adv(only(value, AF1_BITS)?),
            _ => return Err(Unmodelled),
        }
        self.settle(context);
        Ok(())
    }

    fn due(&self) -> Cycles {
        self.due
    }

    fn act(&mut self, context: &mut Context) {
        while self.ramp.due() <= context.now {
            self.turn();
        }
        self.settle(context);
    }
}
