use stm32_metapac::timer::vals::FilterValue;

use super::*;
use crate::chip::bench::Bench;

/// When the counter starts.
const START: Cycles = 5000;

const UG: u32 = 1;
const CCR2: u32 = CCR1 + 4;
const CCR3: u32 = CCR1 + 8;

/// Samples of the filter that the image uses.
const FILTER: Cycles = 4;

/// TIM2, running, with both channels and their requests on the one pin.
fn capturing() -> Bench<Timer> {
    let mut bench = Bench::new(Timer::tim2(), START);
    bench.write(PSC, 0);
    bench.write(ARR, u32::MAX);
    let mut ccmr = CcmrInput2ch(0);
    ccmr.set_ccs(0, CcmrInputCcs::TI4);
    ccmr.set_ccs(1, CcmrInputCcs::TI3);
    ccmr.set_icf(0, FilterValue::FCK_INT_N4);
    ccmr.set_icf(1, FilterValue::FCK_INT_N4);
    bench.write(CCMR1, ccmr.0);
    // The second channel captures the falling edges.
    bench.write(CCER, 0x31);
    bench.write(DIER, 0x600);
    bench.write(EGR, UG);
    bench.write(CR1, 1);
    bench
}

fn pin(bench: &mut Bench<Timer>, at: Cycles, level: bool) {
    bench.until(at);
    bench.with(|timer, context| timer.pin(level, context));
}

fn requests(bench: &Bench<Timer>) -> Vec<(Cycles, u8)> {
    let request = |(at, signal): &(Cycles, Signal)| match *signal {
        Signal::Request(number) => Some((*at, number)),
        _ => None,
    };
    bench.log.iter().filter_map(request).collect()
}

fn lines(bench: &Bench<Timer>) -> Vec<(Cycles, u16, bool)> {
    let line = |(at, signal): &(Cycles, Signal)| match *signal {
        Signal::Interrupt(number, up) => Some((*at, number, up)),
        _ => None,
    };
    bench.log.iter().filter_map(line).collect()
}

#[test]
fn a_train_of_pulses_is_captured() {
    let mut bench = capturing();
    // DShot600: bits of 283 cycles, high for 212 or 106 of them.
    let mut wanted = Vec::new();
    let mut captured = Vec::new();
    for (number, bit) in [true, false, false, true, true].into_iter().enumerate() {
        let rises = START + 1000 + 283 * number as Cycles;
        let falls = rises + if bit { 212 } else { 106 };
        for (at, level, request, register) in [(rises, true, 56, CCR1), (falls, false, 57, CCR2)] {
            pin(&mut bench, at, level);
            bench.until(at + 20);
            wanted.push((at + FILTER, request));
            // As the DMA does.
            captured.push((START + Cycles::from(bench.read(register)), request));
        }
    }
    assert_eq!(requests(&bench), wanted);
    assert_eq!(captured, wanted);
    assert_eq!(bench.read(SR) & 0x606, 0);
}

#[test]
fn a_spike_is_nothing() {
    let mut bench = capturing();
    pin(&mut bench, START + 100, true);
    pin(&mut bench, START + 103, false);
    pin(&mut bench, START + 200, true);
    pin(&mut bench, START + 204, false);
    bench.until(START + 300);
    assert_eq!(requests(&bench), [(START + 204, 56), (START + 208, 57)]);
}

#[test]
fn a_capture_that_is_not_read_is_overwritten_and_told() {
    let mut bench = capturing();
    pin(&mut bench, START + 100, true);
    pin(&mut bench, START + 200, false);
    assert_eq!(bench.read(SR) & 0x606, 0x002);
    pin(&mut bench, START + 300, true);
    bench.until(START + 400);
    assert_eq!(bench.read(SR) & 0x606, 0x206);
    assert_eq!(bench.read(CCR1), 304);
    assert_eq!(bench.read(SR) & 0x606, 0x204);
    bench.write(SR, 0);
    assert_eq!(bench.read(SR), 0);
}

#[test]
fn an_edge_interrupts_until_it_is_read() {
    let mut bench = capturing();
    bench.write(DIER, 0x606);
    pin(&mut bench, START + 100, true);
    bench.until(START + 150);
    bench.read(CCR1);
    assert_eq!(
        lines(&bench),
        [(START + 104, 28, true), (START + 150, 28, false)]
    );
}

#[test]
fn the_alarm_rings_at_its_count() {
    let mut bench = capturing();
    bench.until(START + 1000);
    bench.write(CCR3, 2500);
    bench.write(SR, !(1 << 3));
    bench.write(DIER, 0x608);
    bench.until(START + 2510);
    bench.write(DIER, 0x600);
    bench.write(DIER, 0x608);
    bench.write(SR, !(1 << 3));
    bench.until(START + 10_000);
    assert_eq!(
        lines(&bench),
        [
            (START + 2500, 28, true),
            (START + 2510, 28, false),
            (START + 2510, 28, true),
            (START + 2510, 28, false),
        ]
    );
}

#[test]
fn the_long_counter_wraps_after_32_bits() {
    let mut bench = capturing();
    bench.until(START + (1 << 32) - 1);
    assert_eq!(bench.read(CNT), u32::MAX);
    bench.until(START + (1 << 32));
    assert_eq!(bench.read(CNT), 0);
    bench.until(START + (1 << 32) + 7);
    assert_eq!(bench.read(CNT), 7);
}

/// TIM4 as the time driver sets it up: in microseconds, with interrupts halfway and at the overflow.
fn clock() -> Bench<Timer> {
    let mut bench = Bench::new(Timer::tim4(), START);
    bench.write(CR1, 0);
    bench.write(CNT, 0);
    bench.write(PSC, 169);
    bench.write(ARR, 0xffff);
    bench.write(CR1, 4);
    bench.write(EGR, UG);
    bench.write(CR1, 0);
    assert_eq!(bench.read(SR), 0);
    bench.write(CCR1, 0x8000);
    bench.write(DIER, 3);
    bench.write(CR1, 1);
    bench
}

#[test]
fn the_clock_counts_microseconds() {
    let mut bench = clock();
    for (cycles, count) in [(169, 0), (170, 1), (339, 1), (1700, 10)] {
        bench.until(START + cycles);
        assert_eq!(bench.read(CNT), count);
    }
    // The alarm, on the second channel.
    bench.write(CCR2, 1000);
    bench.write(DIER, 7);
    let mut flags = Vec::new();
    for at in [1000, 0x8000, 0x10000, 0x10000 + 1000] {
        bench.until(START + 170 * at - 1);
        flags.push(bench.read(SR) & 7);
        bench.until(START + 170 * at);
        flags.push(bench.read(SR) & 7);
        bench.write(SR, !7);
    }
    assert_eq!(flags, [0, 4, 0, 2, 0, 1, 0, 4]);
    let rises: Vec<_> = lines(&bench)
        .into_iter()
        .filter_map(|(at, number, up)| up.then_some(((at - START) / 170, number)))
        .collect();
    assert_eq!(
        rises,
        [(1000, 30), (0x8000, 30), (0x10000, 30), (66_536, 30)]
    );
}

#[test]
fn a_stopped_counter_keeps_its_value() {
    let mut bench = clock();
    bench.until(START + 170 * 5 + 100);
    bench.write(CR1, 0);
    bench.until(START + 10_000);
    assert_eq!(bench.read(CNT), 5);
    bench.write(CCR2, 6);
    bench.write(DIER, 4);
    bench.write(CR1, 1);
    // The prescaler was at 100 of 170.
    bench.until(START + 10_069);
    assert_eq!(bench.read(CNT), 5);
    bench.until(START + 10_070);
    assert_eq!(bench.read(CNT), 6);
    assert_eq!(lines(&bench), [(START + 10_070, 30, true)]);
    bench.write(CNT, 100);
    bench.until(START + 10_240);
    assert_eq!(bench.read(CNT), 101);
}

/// TIM3 as it paces replies: first `first` cycles, then `others`.
fn pacing(first: u32, others: u32) -> Bench<Timer> {
    let mut bench = Bench::new(Timer::tim3(), START);
    bench.write(CR1, 0x84);
    bench.write(DIER, 0x100);
    bench.write(CNT, 0);
    bench.write(ARR, first - 1);
    bench.write(EGR, UG);
    bench.write(ARR, others - 1);
    bench.write(CR1, 0x85);
    bench
}

#[test]
fn updates_request_at_the_period_that_was_loaded() {
    let mut bench = pacing(5100, 227);
    bench.until(START + 5600);
    bench.write(CR1, 0x84);
    bench.until(START + 50_000);
    let at = |cycles| (START + cycles, 65);
    assert_eq!(requests(&bench), [at(5100), at(5327), at(5554)]);
    assert_eq!(lines(&bench), []);
}

#[test]
fn a_request_stands_until_it_is_served_or_its_enable_is_taken_away() {
    let mut bench = pacing(5100, 227);
    let standing = |bench: &Bench<Timer>| bench.part.requests().last();
    bench.until(START + 5099);
    assert_eq!(standing(&bench), None);
    bench.until(START + 5100);
    assert_eq!(standing(&bench), Some(65));
    bench.part.served(64);
    assert_eq!(standing(&bench), Some(65));
    bench.part.served(65);
    assert_eq!(standing(&bench), None);
    // A request that nobody serves is a single one, however often it is repeated.
    bench.until(START + 20_000);
    bench.write(CR1, 0x84);
    assert_eq!(bench.part.requests().collect::<Vec<_>>(), [65]);
    bench.write(DIER, 0);
    bench.write(DIER, 0x100);
    assert_eq!(standing(&bench), None);
}

#[test]
fn a_period_of_nothing_stands() {
    let mut bench = pacing(1, 227);
    assert_eq!(bench.part.due(), NEVER);
    bench.until(START + 50_000);
    assert_eq!(bench.read(CNT), 0);
    assert_eq!(requests(&bench), []);
}

#[test]
fn a_reset_lowers_the_line() {
    let mut bench = clock();
    bench.until(START + 170 * 0x8000 + 5);
    bench.with(Timer::reset);
    bench.until(START + 170 * 0x20000);
    let at = START + 170 * 0x8000;
    assert_eq!(lines(&bench), [(at, 30, true), (at + 5, 30, false)]);
    assert_eq!(bench.read(PSC), 0);
}

#[test]
fn what_is_not_followed_is_refused() {
    let mut bench = Bench::new(Timer::tim3(), START);
    for (offset, value) in [
        // Down, centre-aligned, one pulse, no updates.
        (CR1, 0x10),
        (CR1, 0x20),
        (CR1, 0x08),
        (CR1, 0x02),
        (DIER, 0x40),
        // The second pin; a divided capture; an output's mode.
        (CCMR1, 0x0002),
        (CCMR1, 0x0100),
        (CCMR1, 0x0005),
        (CCMR1, 0x0060),
        (CCMR2, 0x0001),
        // Both edges; an output.
        (CCER, 0x0008),
        (CCER, 0x0100),
        (ARR, 0x1_0000),
        (CCR1, 0x1_0000),
        (CNT, 0x1_0000),
        (EGR, 2),
        (0x04, 0),
        (0x08, 0),
        (0x44, 0),
    ] {
        let result = bench.try_write(offset, value);
        assert_eq!(result, Err(Unmodelled), "{offset:#x} {value:#x}");
    }
}
