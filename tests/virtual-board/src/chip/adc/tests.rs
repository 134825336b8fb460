use stm32_metapac::adc::regs::{Cr, Isr, Jsqr, Smpr, Smpr2, Sqr1};
use stm32_metapac::adc::vals::{Exten, SampleTime};

use super::*;
use crate::time::NEVER;

const ISR: u32 = 0x00;
const IER: u32 = 0x04;
const CR: u32 = 0x08;
const SMPR1: u32 = 0x14;
const SMPR2: u32 = 0x18;
const SQR1: u32 = 0x30;
const DR: u32 = 0x40;
const JSQR: u32 = 0x4c;
const JDR1: u32 = 0x80;

const ADVREGEN: u32 = 1 << 28;

/// The converters with their time.
struct Bench {
    converters: Converters,
    now: Cycles,
    heard: Vec<(Cycles, Signal)>,
    volts: f64,
}

impl Bench {
    fn new() -> Self {
        Self {
            converters: Converters::new(),
            now: 0,
            heard: Vec::new(),
            volts: 0.0,
        }
    }

    fn with<T>(&mut self, act: impl FnOnce(&mut Converters, &mut Context) -> T) -> T {
        let mut signals = Vec::new();
        let now = self.now;
        let mut context = Context {
            now,
            signals: &mut signals,
        };
        let result = act(&mut self.converters, &mut context);
        for signal in signals {
            if let Signal::Sample { converter, .. } = signal {
                self.converters.sampled(converter, self.volts);
            }
            self.heard.push((now, signal));
        }
        result
    }

    fn read(&mut self, offset: u32) -> u32 {
        self.with(|part, context| part.read(offset, context))
            .expect("modelled")
    }

    fn try_write(&mut self, offset: u32, value: u32) -> Result<(), Unmodelled> {
        self.with(|part, context| part.write(offset, value, context))
    }

    fn write(&mut self, offset: u32, value: u32) {
        self.try_write(offset, value).expect("modelled");
    }

    /// Gives an order to a converter whose supply is on.
    fn order(&mut self, at: u32, bit: u32) {
        self.write(at + CR, ADVREGEN | bit);
    }

    /// Runs until a time.
    fn run_to(&mut self, end: Cycles) {
        while self.converters.due() <= end {
            self.now = self.converters.due();
            self.with(Part::act);
        }
        self.now = end;
    }

    fn trigger(&mut self) {
        self.with(Converters::trigger);
    }

    /// Enables one, in the HAL's order.
    fn switch_on(&mut self, at: u32) {
        // 170 MHz divided by 4.
        self.write(CCR, 2 << 18);
        self.write(at + CR, ADVREGEN);
        self.run_to(self.now + 3400);
        self.order(at, 1 << 31);
        self.run_to(self.now + 464);
        assert!(!Cr(self.read(at + CR)).adcal());
        self.run_to(self.now + 16);
        self.order(at, 1);
        self.run_to(self.now + 60);
        assert!(Isr(self.read(at + ISR)).adrdy());
    }

    /// The board's sequences, armed.
    fn armed() -> Self {
        let mut bench = Self::new();
        for at in [0x100, 0] {
            bench.switch_on(at);
        }
        let first = [
            (13, SampleTime::CYCLES12_5),
            (12, SampleTime::CYCLES12_5),
            (14, SampleTime::CYCLES24_5),
            (1, SampleTime::CYCLES47_5),
        ];
        let second = [
            (16, SampleTime::CYCLES12_5),
            (17, SampleTime::CYCLES24_5),
            (5, SampleTime::CYCLES24_5),
        ];
        for (at, sequence) in [(0x100, &second[..]), (0, &first[..])] {
            let (mut low, mut high, mut ranks) = (Smpr(0), Smpr2(0), Jsqr(0));
            for (rank, (channel, time)) in sequence.iter().enumerate() {
                match channel {
                    0..=9 => low.set_smp(*channel, *time),
                    _ => high.set_smp(channel - 10, *time),
                }
                ranks.set_jsq(rank, *channel as u8);
            }
            // The thermistor's.
            if at == 0 {
                low.set_smp(5, SampleTime::CYCLES247_5);
                let mut regular = Sqr1(0);
                regular.set_sq(0, 5);
                bench.write(SQR1, regular.0);
            }
            ranks.set_jl(sequence.len() as u8 - 1);
            ranks.set_jextsel(0);
            ranks.set_jexten(Exten::RISING_EDGE);
            bench.write(at + SMPR1, low.0);
            bench.write(at + SMPR2, high.0);
            bench.write(at + JSQR, ranks.0);
            bench.order(at, 1 << 3);
        }
        bench.write(IER, 1 << 6);
        bench.write(ISR, 0x7ff);
        bench.heard.clear();
        bench
    }

    /// Returns the samples requested: converter, channel, cycles since `from`.
    fn samples(&self, from: Cycles) -> Vec<(u8, u8, Cycles)> {
        let sample = |&(at, signal): &_| match signal {
            Signal::Sample { converter, channel } => Some((converter, channel, at - from)),
            _ => None,
        };
        self.heard.iter().filter_map(sample).collect()
    }
}

/// Worked out by hand, in clocks of 4 cycles from the trigger, with 2 of latency: the first samples for
/// 12.5, 12.5, 24.5 and 47.5, each with 12.5 after it, the second for 12.5, 24.5, 24.5. The end is at 2 +
/// 97 + 4 · 12.5 clocks.
#[test]
fn a_trigger_converts_both_sequences_at_their_times() {
    let mut bench = Bench::armed();
    let start = bench.now;
    bench.volts = 1.65;
    bench.trigger();
    bench.run_to(start + 595);
    assert_eq!(bench.converters.due(), start + 596);
    assert!(!Isr(bench.read(ISR)).jeos());
    bench.run_to(start + 596);
    let mut samples = bench.samples(start);
    samples.sort_unstable();
    let first = [(1, 1, 546), (1, 12, 158), (1, 13, 58), (1, 14, 306)];
    let second = [(2, 5, 354), (2, 16, 58), (2, 17, 206)];
    assert_eq!(samples, [&first[..], &second[..]].concat());
    assert_eq!(
        bench.heard.last(),
        Some(&(start + 596, Signal::Interrupt(18, true)))
    );
    for rank in 0..4 {
        assert_eq!(bench.read(JDR1 + 4 * rank), 2048);
    }
    bench.write(ISR, 1 << 6);
    assert_eq!(
        bench.heard.last(),
        Some(&(start + 596, Signal::Interrupt(18, false)))
    );
}

/// The windows stated by the board's firmware, in µs from the counter's top; the trigger comes half of the
/// first window earlier. They exclude the converters' latency.
#[test]
fn the_windows_are_those_of_the_board_and_the_latency() {
    const FIRST: [(f64, f64); 4] = [(-0.15, 0.15), (0.44, 0.74), (1.03, 1.61), (1.90, 3.02)];
    const SECOND: [(f64, f64); 3] = [(-0.15, 0.15), (0.44, 1.02), (1.31, 1.89)];
    const LATENCY_US: f64 = 8.0 / 170.0;
    let mut bench = Bench::armed();
    let start = bench.now;
    bench.trigger();
    bench.run_to(start + 1000);
    for (converter, windows) in [(1, &FIRST[..]), (2, &SECOND[..])] {
        let ends = bench.samples(start);
        let ends = ends.iter().filter(|(which, ..)| *which == converter);
        for ((_, end), (.., at)) in windows.iter().zip(ends) {
            let from_top = (*at as f64 - 25.0) / 170.0 - LATENCY_US;
            assert!((from_top - end).abs() < 0.01, "{end}: {from_top}");
        }
    }
}

#[test]
fn a_trigger_during_a_sequence_is_ignored() {
    let mut bench = Bench::armed();
    let start = bench.now;
    bench.trigger();
    // The second converter has finished its three ranks at 404 and takes the next trigger.
    bench.run_to(start + 500);
    bench.trigger();
    bench.run_to(start + 2000);
    assert_eq!(bench.converters.ignored(1), 1);
    assert_eq!(bench.converters.ignored(2), 0);
    let of = |which| bench.samples(start).iter().filter(|s| s.0 == which).count();
    assert_eq!([of(1), of(2)], [4, 6]);
}

#[test]
fn a_regular_conversion_alone() {
    let mut bench = Bench::armed();
    let start = bench.now;
    bench.volts = 1.1;
    bench.order(0, 1 << 2);
    // 2, 247.5 and 12.5 clocks.
    bench.run_to(start + 1047);
    assert!(!Isr(bench.read(ISR)).eoc());
    bench.run_to(start + 1048);
    assert_eq!(bench.samples(start), [(1, 5, 998)]);
    assert!(Isr(bench.read(ISR)).eoc());
    // 1.1 V of 3.3 V is 1365.33.
    assert_eq!(bench.read(DR), 1365);
    assert!(!Isr(bench.read(ISR)).eoc());
    assert!(!Cr(bench.read(CR)).adstart());
}

#[test]
fn an_injected_sequence_breaks_into_a_regular_conversion_which_begins_again() {
    let mut bench = Bench::armed();
    let start = bench.now;
    bench.order(0, 1 << 2);
    bench.run_to(start + 600);
    bench.trigger();
    // The latency is 3 clocks now: the sequence's 588 cycles end at 600 + 12 + 588, and the regular
    // conversion's 1040 follow.
    bench.run_to(start + 1200);
    assert!(Isr(bench.read(ISR)).jeos());
    bench.run_to(start + 2239);
    assert!(!Isr(bench.read(ISR)).eoc());
    bench.run_to(start + 2240);
    assert!(Isr(bench.read(ISR)).eoc());
    let regular = bench.samples(start);
    let regular: Vec<_> = regular.iter().filter(|s| s.1 == 5 && s.0 == 1).collect();
    assert_eq!(regular, [&(1, 5, 2190)]);
}

#[test]
fn readings_are_rounded_down_and_clamped() {
    let mut bench = Bench::armed();
    for (volts, counts) in [
        (-0.5, 0),
        (0.0008, 0),
        (0.00081, 1),
        (3.2991, 4094),
        (3.2992, 4095),
        (3.4, 4095),
    ] {
        bench.volts = volts;
        bench.trigger();
        bench.run_to(bench.now + 1000);
        assert_eq!(bench.read(JDR1), counts, "{volts} V");
    }
}

#[test]
fn one_that_is_not_armed_ignores_the_trigger() {
    let mut bench = Bench::new();
    bench.switch_on(0);
    bench.trigger();
    assert_eq!(bench.converters.due(), NEVER);
}

#[test]
fn what_is_not_to_be_done_is_refused() {
    let mut bench = Bench::new();
    // 170 MHz is too fast.
    assert_eq!(bench.try_write(CR, 1 << 28), Err(Unmodelled));
    bench.write(CCR, 2 << 18);
    bench.write(CR, 1 << 28);
    bench.run_to(3399);
    assert_eq!(bench.try_write(CR, 1 << 28 | 1 << 31), Err(Unmodelled));

    let mut bench = Bench::armed();
    // Sampling times of an armed converter, its queue, and the clock of enabled converters.
    for (offset, value) in [(SMPR1, 0), (JSQR, 0), (0x0c, 0), (CCR, 1 << 18), (0x20, 0)] {
        assert_eq!(bench.try_write(offset, value), Err(Unmodelled), "{offset}");
    }
    // Orders written back with another one: ADEN and JADSTART with ADSTART.
    let read = bench.read(CR);
    assert_eq!(bench.try_write(CR, read | 1 << 2), Err(Unmodelled));
    // Old values may be written.
    let same = bench.read(SMPR1);
    bench.write(SMPR1, same);
    bench.write(CCR, 2 << 18);
}

#[test]
fn a_regular_conversion_that_is_asked_for_during_a_sequence_follows_it() {
    let mut bench = Bench::armed();
    let start = bench.now;
    bench.trigger();
    bench.run_to(start + 100);
    bench.order(0, 1 << 2);
    // The sequence ends at 596.
    bench.run_to(start + 596 + 1039);
    assert!(!Isr(bench.read(ISR)).eoc());
    bench.run_to(start + 596 + 1040);
    assert!(Isr(bench.read(ISR)).eoc());
}

#[test]
fn a_reading_that_nobody_fetches_is_kept_and_overrun() {
    let mut bench = Bench::armed();
    for volts in [1.1, 2.2] {
        bench.volts = volts;
        bench.order(0, 1 << 2);
        bench.run_to(bench.now + 2000);
    }
    assert!(Isr(bench.read(ISR)).ovr());
    assert_eq!(bench.read(DR), 1365);
}

#[test]
fn a_reset_takes_the_interrupt_and_the_settings_back() {
    let mut bench = Bench::armed();
    bench.trigger();
    bench.run_to(bench.now + 1000);
    let last = |bench: &Bench| bench.heard.last().map(|(_, signal)| *signal);
    assert_eq!(last(&bench), Some(Signal::Interrupt(18, true)));
    bench.with(Converters::reset);
    assert_eq!(last(&bench), Some(Signal::Interrupt(18, false)));
    assert_eq!(bench.read(SQR1), 0);
    assert_eq!(bench.read(CR), 1 << 29);
}
