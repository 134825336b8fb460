//! The two converters: injected sequences at the PWM timer's trigger, and readings in between.

use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::regs::{Cr, Jsqr};
use embassy_stm32::pac::adc::vals::{Exten, SampleTime};
use embassy_stm32::pac::adccommon::vals::Presc;
use embassy_stm32::pac::{ADC1, ADC2, ADC12_COMMON, RCC};

use super::TIMER_HZ;

/// TIM1_TRGO among the triggers of an injected sequence (RM0440, ADC1/2 injected channels' external
/// triggers).
const TIM1_TRGO: u8 = 0;

/// The longest start of a converter's regulator, in processor clocks: 20 µs (data sheet).
const REGULATED: u32 = TIMER_HZ / 1_000_000 * 20;

/// More than the four clocks of the converters that must pass between calibration and switching on
/// (RM0440, calibration), in processor clocks.
const CALIBRATED: u32 = 100;

/// A quarter of [`TIMER_HZ`], 42.5 MHz; 60 MHz is the most.
const DIVIDER: Presc = Presc::DIV4;

/// Calibrates both converters and switches them on. To be called once, after a reset.
pub(crate) fn switch_on() {
    RCC.ahb2enr().modify(|w| w.set_adc12en(true));
    ADC12_COMMON.ccr().write(|w| w.set_presc(DIVIDER));
    for converter in [ADC1, ADC2] {
        converter.cr().write(|w| w.set_advregen(true));
    }
    cortex_m::asm::delay(REGULATED);
    for converter in [ADC1, ADC2] {
        command(converter, |w| w.set_adcal(true));
        while converter.cr().read().adcal() {}
        cortex_m::asm::delay(CALIBRATED);
        command(converter, |w| w.set_aden(true));
        while !converter.isr().read().adrdy() {}
    }
}

/// Has a converter convert these channels, each with its sampling time, at each trigger of TIM1. The end
/// of the sequence is an interrupt if it `interrupts`.
pub(crate) fn convert(converter: Adc, sequence: &[(u8, SampleTime)], interrupts: bool) {
    let mut ranks = Jsqr(0);
    ranks.set_jl(sequence.len() as u8 - 1);
    ranks.set_jextsel(TIM1_TRGO);
    ranks.set_jexten(Exten::RISING_EDGE);
    for (rank, &(channel, time)) in sequence.iter().take(4).enumerate() {
        ranks.set_jsq(rank, channel);
        sample_for(converter, channel, time);
    }
    converter.jsqr().write_value(ranks);
    converter.ier().write(|w| w.set_jeosie(interrupts));
    command(converter, |w| w.set_jadstart(true));
}

/// Sets a channel's sampling time: while nothing is converted (RM0440, ADC_SMPR1).
fn sample_for(converter: Adc, channel: u8, time: SampleTime) {
    let channel = usize::from(channel);
    if channel < 10 {
        converter.smpr().modify(|w| w.set_smp(channel, time));
    } else {
        let channel = (channel - 10) % 9;
        converter.smpr2().modify(|w| w.set_smp(channel, time));
    }
}

/// Gives a converter that is supplied an order: what it is at stays as it is. Its orders are bits that are set by
/// ones and left by zeros (RM0440, ADC_CR), so one that has ended since it was read would be given again by being
/// written back.
fn command(converter: Adc, order: impl FnOnce(&mut Cr)) {
    converter.cr().write(|w| {
        w.set_advregen(true);
        order(w);
    });
}

/// Tries of a reading, so that a task is not held up for ever.
const TRIES: u32 = 8;

/// A reading of one of the first converter's pins, between its injected ones.
pub(crate) struct Reading {
    /// The last one that no injected conversion came near.
    counts: u16,
}

impl Reading {
    /// Readings of a channel. To be made once the converters are on, and before the first one's sequence.
    pub(crate) fn new(channel: u8) -> Self {
        ADC1.sqr1().write(|w| w.set_sq(0, channel));
        sample_for(ADC1, channel, SampleTime::CYCLES92_5);
        Self { counts: 0 }
    }

    /// The reading, of 4096. For the tasks: it waits for it, some 8 µs, or as often as it is disturbed.
    /// `periods` counts the control periods, each of which follows injected conversions.
    ///
    /// A regular conversion after injected ones may be one of channel 0 (ES0431, 2.5.8): it counts where
    /// another stands before it and no period has gone by since. Both take half of the fastest PWM's
    /// period; if something else holds them up each time, the reading before stays.
    pub(crate) fn counts(&mut self, periods: impl Fn() -> u32) -> u16 {
        for _ in 0..TRIES {
            let before = periods();
            self.convert();
            let counts = self.convert();
            if periods() == before {
                self.counts = counts;
                break;
            }
        }
        self.counts
    }

    fn convert(&mut self) -> u16 {
        command(ADC1, |w| w.set_adstart(true));
        while !ADC1.isr().read().eoc() {}
        ADC1.dr().read().rdata()
    }
}
