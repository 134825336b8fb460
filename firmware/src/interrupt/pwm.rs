//! The bridge's PWM: TIM1, centre-aligned, complementary, with dead time.
//!
//! The counter runs from 0 to the top and back in PWM mode 1: a high side is on below its compare value, so the
//! top is in the middle of the low sides' on-time. There channel 4 triggers the converters. New duties are
//! written after the top and take effect at the next one, a period later.
//!
//! A phase's state ([`Leg`]) is in the channels' mode and enable bits. These are preloaded too (CCPC), but the
//! timer takes them at its commutation event, not at the top: the control interrupt triggers one first thing,
//! 3 µs after the top at which the matching duties were taken. In between, the old switches see the new duties: a
//! released phase keeps its low side on for that long, and one that joins starts to switch that much later.
//!
//! The hardware changes all bits of all phases in the same clock, so no order of writes can turn on both
//! switches of a phase. Dead time is inserted on edges of the reference output, which a commutation creates
//! when it leaves or enters a forced level. From low side alone to both switches there may be no edge: the mode
//! changes from 2 to 1, the reference may stay high until the next compare match, and what it drives would
//! become the high side in the same clock. Such a change goes through all switches off, in two commutations; in
//! the other direction, where the high sides may just have been on, everything stays off for a period.
//! [`Bridge::Off`] waits for none of this: the main output enable acts at once.

use embassy_stm32::pac::timer::TimAdv;
use embassy_stm32::pac::timer::regs::{Ccr1ch, SrAdv};
use embassy_stm32::pac::timer::vals::{Bkp, Cms, Dir, FilterValue, Mms, Ossi, Ossr};
use siskin_control::drive::Bridge;
use siskin_units::Duty;

use super::leg::{Leg, Modes};
use super::timing::{Timing, compare};
use crate::board::{PHASES, SAMPLING_CLOCKS};
use crate::chip::bridge::turn_off;

/// The running PWM.
pub(crate) struct Pwm {
    timer: TimAdv,
    /// The counter's top.
    top: u16,
    /// The low sides as the last [`apply`](Self::apply) wrote them.
    low_sides: LowSides,
    /// What follows all switches off, in the next commutation.
    deferred: Option<Modes>,
}

impl Pwm {
    /// Sets the timer up with all switches off; [`start`](Self::start) starts it.
    pub(crate) fn new(timer: TimAdv, timing: Timing) -> Self {
        timer.cr1().write(|w| {
            w.set_cms(Cms::CENTER_ALIGNED1);
            w.set_arpe(true);
        });
        timer.cr2().write(|w| w.set_mms(Mms::COMPARE_OC4));
        // Channel 4 has no pin. Its rising edge, half a sampling window before the top, triggers the
        // converters; their start delay of two to three of their clocks (0.07 µs) is neglected.
        timer.ccer().write(|w| w.set_cce(3, true));
        // With the main output disabled the outputs are driven to their idle level, low: both switches of every
        // phase are off. With it enabled, a disabled output is driven low if its complement is enabled. The
        // break takes six samples at a sixteenth of the clock, 0.56 µs, since every switching edge rings at the
        // comparators.
        timer.bdtr().write(|w| {
            w.set_ossi(Ossi::IDLE_LEVEL);
            w.set_ossr(Ossr::IDLE_LEVEL);
            w.set_bkp(0, Bkp::ACTIVE_HIGH);
            w.set_bkf(0, FilterValue::FDTS_DIV16_N6);
            w.set_bke(0, crate::board::BREAKS);
            w.set_dtg(timing.dead_time);
        });
        timer.arr().write(|w| w.set_arr(timing.top));
        (timer.ccr(3)).write(|w| w.set_ccr(timing.top - SAMPLING_CLOCKS / 2));
        let mut pwm = Self {
            timer,
            top: timing.top,
            low_sides: LowSides::None,
            deferred: None,
        };
        pwm.set_modes(Modes::off());
        // From here on modes and enable bits wait for a commutation, channel 4's too.
        timer.cr2().modify(|w| w.set_ccpc(true));
        pwm.commutate();
        pwm
    }

    /// Starts the counter with all switches off, and makes duties take effect at the top. Call it with
    /// interrupts masked, except the PWM's own, which is not enabled yet.
    pub(crate) fn start(&mut self) {
        let timer = self.timer;
        // With a repetition count of 0 the first update is at the first top. The count of 1, written after the
        // start, is loaded there and makes every second turning point an update: the tops, not the zeros.
        timer.rcr().write(|w| w.set_rep(0));
        timer.egr().write(|w| w.set_ug(true));
        timer.cr1().modify(|w| w.set_cen(true));
        timer.rcr().write(|w| w.set_rep(1));
        for _ in 0..2 {
            timer.sr().modify(|w| w.set_uif(false));
            while !timer.sr().read().uif() {}
        }
        assert!(
            timer.cr1().read().dir() == Dir::DOWN,
            "after the update at the top the counter goes down"
        );
    }

    /// Puts the legs of the last [`apply`](Self::apply) into force.
    #[inline(always)] // in each period
    pub(crate) fn commutate(&mut self) {
        self.timer.egr().write(|w| w.set_comg(true));
        if self.deferred.is_some() {
            self.second();
        }
    }

    /// Returns true if the last command needs another commutation: it took long.
    pub(crate) fn is_deferred(&self) -> bool {
        self.deferred.is_some()
    }

    #[cold]
    fn second(&mut self) {
        if let Some(modes) = self.deferred.take() {
            self.set_modes(modes);
            self.timer.egr().write(|w| w.set_comg(true));
        }
    }

    /// Returns true if the break has turned the bridge off since [`clear_break`](Self::clear_break).
    #[inline(always)] // in each period
    pub(crate) fn broken(&self) -> bool {
        self.timer.sr().read().bif(0)
    }

    /// Clears a break; the hardware holds the bridge off as long as its cause lasts.
    #[cold]
    #[inline(never)] // only after a break
    pub(crate) fn clear_break(&mut self) {
        // Writing 1 leaves bits unchanged.
        let mut others = SrAdv(!0);
        others.set_bif(0, false);
        self.timer.sr().write_value(others);
    }

    /// Applies the control's bridge command from the counter's next top on. Off takes effect at once, and
    /// afterwards all switches stay off until the top.
    #[inline(always)] // in each period
    pub(crate) fn apply(&mut self, bridge: Bridge) {
        // Most periods first: a `match` over all kinds looks their place up in a table.
        if let (Bridge::Duty([a, b, c]), LowSides::Switching) = (bridge, self.low_sides) {
            let top = self.top;
            // The main output has been on since the previous period, or a break has turned it off.
            return self.set_compares([compare(a, top), compare(b, top), compare(c, top)]);
        }
        // All periods of a six-step drive but those with a commutation.
        if let (Bridge::Legs([a, b, c]), LowSides::Some(open)) = (bridge, self.low_sides)
            && open == open_legs([a, b, c])
        {
            let compare = |duty: Option<Duty>| compare(duty.unwrap_or(Duty::ZERO), self.top);
            return self.set_compares([compare(a), compare(b), compare(c)]);
        }
        match (bridge, self.low_sides) {
            (Bridge::Brake, LowSides::Switching) => self.set_compares([0; 3]),
            (Bridge::Off, _) => self.off(),
            (Bridge::Charge(share), LowSides::Alone) => {
                self.set_compares([Leg::Low(share).compare(self.top); 3]);
            }
            _ => self.change(bridge),
        }
    }

    /// Applies a command that differs from the previous one in more than its duties.
    #[cold]
    #[inline(never)] // only some periods
    fn change(&mut self, bridge: Bridge) {
        let switching =
            |[a, b, c]: [Duty; 3]| [Leg::Switching(a), Leg::Switching(b), Leg::Switching(c)];
        let open_or = |duty: Option<Duty>| duty.map_or(Leg::Off, Leg::Switching);
        let (wanted, legs) = match bridge {
            Bridge::Off => return self.off(),
            Bridge::Charge(share) => (LowSides::Alone, [Leg::Low(share); 3]),
            Bridge::Brake => (LowSides::Switching, switching([Duty::ZERO; 3])),
            Bridge::Duty(duties) => (LowSides::Switching, switching(duties)),
            Bridge::Legs(duties) => {
                let [a, b, c] = duties;
                let legs = [open_or(a), open_or(b), open_or(c)];
                (LowSides::Some(open_legs(duties)), legs)
            }
        };
        let [a, b, c] = legs;
        let top = self.top;
        self.set_compares([a.compare(top), b.compare(top), c.compare(top)]);
        let with_high_sides =
            |low: LowSides| matches!(low, LowSides::Switching | LowSides::Some(_));
        let modes = Modes::of(legs);
        let (present, modes) = match (self.low_sides, wanted) {
            (before, LowSides::Alone) if with_high_sides(before) => (LowSides::None, Modes::off()),
            (LowSides::Alone, after) if with_high_sides(after) => {
                self.deferred = Some(modes);
                (wanted, Modes::off())
            }
            _ => (wanted, modes),
        };
        self.low_sides = present;
        self.set_modes(modes);
        self.turn_on();
    }

    /// Turns all switches off at once by the main output; the modes follow in the next commutation, since a drive that
    /// ends has had a long period.
    pub(crate) fn off(&mut self) {
        turn_off(self.timer);
        if self.low_sides != LowSides::None {
            self.low_sides = LowSides::None;
            self.deferred = Some(Modes::off());
        }
    }

    fn turn_on(&mut self) {
        // After a break, tell the control first.
        if !self.broken() {
            self.timer.bdtr().modify(|w| w.set_moe(true));
        }
    }

    // Unrolled, here and below: a loop would keep the bounds checks.
    #[inline(always)] // in each period
    fn set_compares(&mut self, values: [u32; 3]) {
        let timer = self.timer;
        timer.ccr(0).write_value(Ccr1ch(values[PHASES[0]]));
        timer.ccr(1).write_value(Ccr1ch(values[PHASES[1]]));
        timer.ccr(2).write_value(Ccr1ch(values[PHASES[2]]));
    }

    /// Writes the modes for the next commutation.
    fn set_modes(&mut self, modes: Modes) {
        let [first, second] = modes.outputs;
        self.timer.ccmr_output(0).write_value(first);
        self.timer.ccmr_output(1).write_value(second);
        self.timer.ccer().write_value(modes.enables);
    }
}

/// Phases with both switches off, a bit each.
type OpenLegs = u8;

fn open_legs([a, b, c]: [Option<Duty>; 3]) -> OpenLegs {
    u8::from(a.is_none()) | u8::from(b.is_none()) << 1 | u8::from(c.is_none()) << 2
}

/// What the low sides do.
#[derive(Clone, Copy, PartialEq)]
enum LowSides {
    /// Nothing: all switches are off.
    None,
    /// Switch without the high sides.
    Alone,
    /// Alternate with the high sides in the phases that are not open: these.
    Some(OpenLegs),
    /// Alternate with the high sides in all phases.
    Switching,
}
