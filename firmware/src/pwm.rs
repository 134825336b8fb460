//! The bridge's PWM: TIM1, centre-aligned, complementary, with dead time.
//!
//! The counter runs from 0 to the top and back, PWM mode 1: a high side is on below its compare
//! value, so the top is in the middle of the low sides' on-time. There channel 4 triggers the
//! converters. New duties are written after the top and taken at the next one, one period later.
//!
//! What a phase does ([`Leg`]) is in the channels' modes and enable bits. These are preloaded too
//! (CCPC), but the timer takes them at its commutation event, not at the top: the control interrupt
//! causes one as its first act, 3 µs after the top at which the duties that go with them were
//! taken. In between the old switches see the new duties: a phase that is let go keeps its low side
//! on for so long, and one that is taken up begins to switch by so much later.
//!
//! The hardware changes all bits of all phases in the same clock, so no order of writes can turn on
//! both switches of a phase. The dead time between them hangs on edges of the reference output,
//! which a commutation makes where it leaves or enters a forced level. From the low side alone to
//! both switches there need not be one: the mode changes from 2 to 1, the reference may stay high
//! until the next comparison, and what it drives would become the high side in the same clock. Such
//! a change goes by way of all switches off, in two commutations; the other way round, where the
//! high sides may just have been on, all stays off for a period. [`Bridge::Off`] does not wait for
//! any of this: the main output enable acts at once.

use core::mem;

use embassy_stm32::Peri;
use embassy_stm32::pac::timer::vals::{Cms, Dir, Mms, Ocm, Ossi, Ossr};
use embassy_stm32::pac::{DBGMCU, TIM1};
use embassy_stm32::peripherals;
use embassy_stm32::rcc;
use embassy_stm32::timer::complementary_pwm::ComplementaryPwmPin;
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::timer::{Ch1, Ch2, Ch3};
use siskin_control::drive::Bridge;
use siskin_control::units::Duty;

use crate::board::SAMPLING_CLOCKS;

/// High side's and low side's pin of the phase on channel `C`.
type PhasePins<C> = (
    PwmPin<'static, peripherals::TIM1, C>,
    ComplementaryPwmPin<'static, peripherals::TIM1, C>,
);

/// The timer and the gate signals of the three phases.
pub(crate) struct BridgePins {
    /// The timer.
    pub(crate) timer: Peri<'static, peripherals::TIM1>,
    /// Phase a.
    pub(crate) a: PhasePins<Ch1>,
    /// Phase b.
    pub(crate) b: PhasePins<Ch2>,
    /// Phase c.
    pub(crate) c: PhasePins<Ch3>,
}

/// The running PWM.
pub(crate) struct Pwm {
    /// The counter's top: half a period in clocks.
    top: u16,
    /// What the last [`apply`](Self::apply) has written.
    low_sides: LowSides,
    /// What follows, in the next commutation, on all switches off.
    deferred: Option<[Leg; 3]>,
}

impl Pwm {
    /// Sets the timer up with all switches off; [`start`](Self::start) lets it count. The
    /// frequency is rounded to a half period of whole clocks, the dead time up to the timer's steps.
    pub(crate) fn new(pins: BridgePins, frequency_hz: f32, dead_time_ns: f32) -> Self {
        rcc::enable_and_reset::<peripherals::TIM1>();
        let clock_hz = rcc::frequency::<peripherals::TIM1>().0 as f32;
        // The table's 8 to 60 kHz give 10625 to 1417 clocks.
        let top = (clock_hz / (2.0 * frequency_hz) + 0.5) as u16;
        let dead_clocks = (clock_hz * 1e-9 * dead_time_ns + 0.999) as u16;

        // A breakpoint stops the timer, and a stopped timer turns its outputs off.
        DBGMCU.apb2fzr().modify(|w| w.set_tim1(true));

        TIM1.cr1().write(|w| {
            w.set_cms(Cms::CENTER_ALIGNED1);
            w.set_arpe(true);
        });
        TIM1.cr2().write(|w| w.set_mms(Mms::COMPARE_OC4));
        TIM1.arr().write(|w| w.set_arr(top));
        for channel in 0..3 {
            TIM1.ccmr_output(channel / 2)
                .modify(|w| w.set_ocpe(channel % 2, true));
        }
        // Channel 4 has no pin. Its rising edge, half a sampling window before the top, starts the
        // converters; their start delay of two to three of their clocks (0.07 µs) is neglected.
        TIM1.ccmr_output(1).modify(|w| w.set_ocm(1, Ocm::PWM_MODE2));
        TIM1.ccer().modify(|w| w.set_cce(3, true));
        TIM1.ccr(3).write(|w| w.set_ccr(top - SAMPLING_CLOCKS / 2));
        // Without the main output enable the outputs are driven to their idle level, low: both
        // switches of every phase are off. With it, an output that is not enabled is driven low
        // where its complement is.
        TIM1.bdtr().write(|w| {
            w.set_ossi(Ossi::IDLE_LEVEL);
            w.set_ossr(Ossr::IDLE_LEVEL);
            w.set_dtg(dead_time_code(dead_clocks));
        });
        // A dropped pin would be given back: these stay the timer's for ever.
        let BridgePins { timer, a, b, c } = pins;
        mem::forget((timer, a, b, c));
        let mut pwm = Self {
            top,
            low_sides: LowSides::None,
            deferred: None,
        };
        // From here on modes and enable bits wait for a commutation, those of channel 4 too.
        TIM1.cr2().modify(|w| w.set_ccpc(true));
        pwm.set_modes([Leg::Off; 3]);
        pwm.commutate();
        pwm
    }

    /// Lets the counter run with all switches off, and sees to it that duties are taken at the top.
    pub(crate) fn start(&mut self) {
        let direction = critical_section::with(|_| {
            // With a repetition count of 0 the first update is at the first top. The count of 1,
            // written behind the start, is taken there and makes every second turn an update: the
            // tops, not the zeros.
            TIM1.rcr().write(|w| w.set_rep(0));
            TIM1.egr().write(|w| w.set_ug(true));
            TIM1.cr1().modify(|w| w.set_cen(true));
            TIM1.rcr().write(|w| w.set_rep(1));
            for _ in 0..2 {
                TIM1.sr().modify(|w| w.set_uif(false));
                while !TIM1.sr().read().uif() {}
            }
            TIM1.cr1().read().dir()
        });
        assert!(
            direction == Dir::DOWN,
            "after the update at the top the counter goes down"
        );
    }

    /// Lets the phases do what the last [`apply`](Self::apply) wanted.
    pub(crate) fn commutate(&mut self) {
        TIM1.egr().write(|w| w.set_comg(true));
        if let Some(legs) = self.deferred.take() {
            self.set_modes(legs);
            TIM1.egr().write(|w| w.set_comg(true));
        }
    }

    /// Does with the bridge what the control wants, from the counter's next top on; to turn it off
    /// takes effect at once, and after that all switches stay off until the top.
    pub(crate) fn apply(&mut self, bridge: Bridge) {
        let switching = |duties: [Duty; 3]| duties.map(Leg::Switching);
        let legs = match bridge {
            Bridge::Off => {
                turn_off();
                self.low_sides = LowSides::None;
                self.deferred = None;
                self.set_modes([Leg::Off; 3]);
                self.commutate();
                return;
            }
            Bridge::Charge(share) => [Leg::Low(share); 3],
            Bridge::Brake => switching([Duty::ZERO; 3]),
            Bridge::Duty(duties) => switching(duties),
            Bridge::Legs(legs) => legs.map(|duty| duty.map_or(Leg::Off, Leg::Switching)),
        };
        for (channel, leg) in legs.into_iter().enumerate() {
            TIM1.ccr(channel)
                .write(|w| w.set_ccr(leg.compare(self.top)));
        }
        let wanted = match bridge {
            Bridge::Charge(_) => LowSides::Alone,
            _ => LowSides::Complementary,
        };
        let (present, modes) = match (self.low_sides, wanted) {
            (LowSides::Complementary, LowSides::Alone) => (LowSides::None, [Leg::Off; 3]),
            (LowSides::Alone, LowSides::Complementary) => {
                self.deferred = Some(legs);
                (wanted, [Leg::Off; 3])
            }
            _ => (wanted, legs),
        };
        self.low_sides = present;
        self.set_modes(modes);
        turn_on();
    }

    /// Writes what the next commutation brings.
    fn set_modes(&mut self, legs: [Leg; 3]) {
        for (channel, leg) in legs.into_iter().enumerate() {
            // The high side is on, or the low side alone, while the reference output is high.
            let (mode, high, low) = match leg {
                // One enabled output keeps the other one driven; the reference is held low.
                Leg::Off => (Ocm::FORCE_INACTIVE, true, false),
                // High above the compare value: around the top.
                Leg::Low(_) => (Ocm::PWM_MODE2, false, true),
                Leg::Switching(_) => (Ocm::PWM_MODE1, true, true),
            };
            TIM1.ccmr_output(channel / 2)
                .modify(|w| w.set_ocm(channel % 2, mode));
            TIM1.ccer().modify(|w| {
                w.set_cce(channel, high);
                w.set_ccne(channel, low);
            });
        }
    }
}

/// What a phase does for a period.
#[derive(Clone, Copy)]
enum Leg {
    /// Both switches are off.
    Off,
    /// The low side is on for this share around the top; the high side is off.
    Low(Duty),
    /// The high side is on for this share, the low side for the rest.
    Switching(Duty),
}

/// How the low sides are driven.
#[derive(Clone, Copy)]
enum LowSides {
    /// Not at all: all switches are off.
    None,
    /// Without the high sides.
    Alone,
    /// In turn with the high sides, in the phases that are not off.
    Complementary,
}

impl Leg {
    fn compare(self, top: u16) -> u16 {
        match self {
            Self::Off => 0,
            Self::Low(share) => top - compare(share, top),
            Self::Switching(duty) => compare(duty, top),
        }
    }
}

/// Turns all switches off, at once. It may be called at any time, also before the timer is set up.
pub(crate) fn turn_off() {
    TIM1.bdtr().modify(|w| w.set_moe(false));
}

fn turn_on() {
    TIM1.bdtr().modify(|w| w.set_moe(true));
}

/// The compare value of a duty: top·duty, at most the top. A duty has 31 fraction bits, so with
/// twice the top the product's upper half is the result.
const fn compare(duty: Duty, top: u16) -> u16 {
    let product = duty.to_bits() as u64 * (2 * top as u32) as u64;
    let value = (product >> 32) as u32;
    if value > top as u32 {
        top
    } else {
        value as u16
    }
}

/// The dead-time generator's code for at least so many clocks: steps of 1 up to 127, of 2 up to
/// 254, of 8 up to 504, of 16 up to 1008, where it ends (5.9 µs at 170 MHz).
const fn dead_time_code(clocks: u16) -> u8 {
    match clocks {
        0..=127 => clocks as u8,
        128..=254 => 0x80 | (clocks.div_ceil(2) - 64) as u8,
        255..=504 => 0xc0 | (clocks.div_ceil(8) - 32) as u8,
        505..=1008 => 0xe0 | (clocks.div_ceil(16) - 32) as u8,
        _ => 0xff,
    }
}

/// Checked whenever this is compiled, since the crate cannot run tests.
const _: () = {
    assert!(dead_time_code(85) == 85);
    assert!(dead_time_code(128) == 0x80);
    assert!(dead_time_code(253) == 0xbf && dead_time_code(254) == 0xbf);
    assert!(dead_time_code(256) == 0xc0 && dead_time_code(504) == 0xdf);
    assert!(dead_time_code(510) == 0xe0 && dead_time_code(1008) == 0xff);
    assert!(compare(Duty::from_bits(0), 3542) == 0);
    assert!(compare(Duty::from_bits(1 << 30), 3542) == 1771);
    assert!(compare(Duty::from_bits(1 << 31), 3542) == 3542);
    assert!(compare(Duty::MAX, 3542) == 3542);
};
