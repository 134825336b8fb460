//! The two converters: injected sequences triggered by the PWM timer, and readings in between.

use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::regs::{Cr, Jsqr};
use embassy_stm32::pac::adc::vals::{Exten, SampleTime};
use embassy_stm32::pac::adccommon::vals::Presc;
use embassy_stm32::pac::{ADC1, ADC2, ADC12_COMMON, RCC};

use super::TIMER_HZ;

/// TIM1_TRGO among the injected triggers (RM0440, ADC1/2 injected channels' external triggers).
const TIM1_TRGO: u8 = 0;

/// Maximum start-up time of a converter's regulator, in processor clocks: 20 µs (data sheet).
const REGULATED: u32 = TIMER_HZ / 1_000_000 * 20;

/// More than the four converter clocks required between calibration and enabling (RM0440, calibration), in
/// processor clocks.
const CALIBRATED: u32 = 100;

/// A quarter of [`TIMER_HZ`], 42.5 MHz; the maximum is 60 MHz.
const DIVIDER: Presc = Presc::DIV4;

/// Calibrates and enables both converters. Call it once, after a reset.
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

/// Makes a converter convert these channels, each with its sampling time, on every TIM1 trigger. With
/// `interrupts`, the end of the sequence raises an interrupt.
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

/// Sets a channel's sampling time; only while nothing is converting (RM0440, ADC_SMPR1).
fn sample_for(converter: Adc, channel: u8, time: SampleTime) {
    let channel = usize::from(channel);
    if channel < 10 {
        converter.smpr().modify(|w| w.set_smp(channel, time));
    } else {
        let channel = (channel - 10) % 9;
        converter.smpr2().modify(|w| w.set_smp(channel, time));
    }
}

/// Gives a powered converter a command without disturbing its state. Command bits are set by writing 1 and
/// ignore 0 (RM0440, ADC_CR), so a read-modify-write could repeat one that ended after the read.
fn command(converter: Adc, order: impl FnOnce(&mut Cr)) {
    converter.cr().write(|w| {
        w.set_advregen(true);
        order(w);
    });
}

/// Attempts at a reading, so that a task is not held up forever.
const TRIES: u32 = 8;

/// Reads one of the first converter's pins, between its injected conversions.
pub(crate) struct Reading {
    /// The last reading that no injected conversion disturbed.
    counts: u16,
}

impl Reading {
    /// Prepares readings of a channel. Call it once the converters are enabled, before the first one's
    /// sequence.
    pub(crate) fn new(channel: u8) -> Self {
        ADC1.sqr1().write(|w| w.set_sq(0, channel));
        sample_for(ADC1, channel, SampleTime::CYCLES92_5);
        Self { counts: 0 }
    }

    /// Returns the reading, out of 4096. For tasks: it waits some 8 µs, or as often as it is disturbed.
    /// `periods` counts the control periods, each of which follows injected conversions.
    ///
    /// A regular conversion after injected ones may be of channel 0 (ES0431, 2.5.8), so a reading counts only
    /// after another one, with no period in between. Both take half of the fastest PWM period; if something
    /// else delays them every time, the previous reading stays.
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
