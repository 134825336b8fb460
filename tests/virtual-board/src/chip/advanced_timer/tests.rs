use stm32_metapac::timer::vals::{FilterValue, Ocm, Ossi, Ossr};

use super::*;
use crate::bridge::Bridge;
use crate::chip::bench::Bench;

/// When the counter starts.
const START: Cycles = 16_000;
const TOP: u16 = 1000;
/// The dead time, in cycles and as its code.
const DEAD: u8 = 20;
/// Channel 4's compare value.
const TRIGGER_AT: u16 = 975;

const UIF: u32 = 1;
const BIF: u32 = 1 << 7;
const UG: u32 = 1;
const COMG: u32 = 1 << 5;
const MOE: u32 = 1 << 15;

fn modes(bench: &mut Bench<AdvancedTimer>, legs: [Ocm; 3]) {
    let mut first = CcmrOutputGp16(0);
    let mut second = CcmrOutputGp16(0);
    for (channel, mode) in legs[..2].iter().enumerate() {
        first.set_ocm(channel, *mode);
        first.set_ocpe(channel, true);
    }
    second.set_ocm(0, legs[2]);
    second.set_ocpe(0, true);
    second.set_ocm(1, Ocm::PWM_MODE2);
    bench.write(CCMR1, first.0);
    bench.write(CCMR2, second.0);
}

fn enables(bench: &mut Bench<AdvancedTimer>, high: bool, low: bool) {
    let mut ccer = CcerAdv(0);
    for leg in 0..LEGS {
        ccer.set_cce(leg, high);
        ccer.set_ccne(leg, low);
    }
    ccer.set_cce(3, true);
    bench.write(CCER, ccer.0);
}

fn compares(bench: &mut Bench<AdvancedTimer>, values: [u16; 3]) {
    for (offset, value) in (CCR1..).step_by(4).zip(values) {
        bench.write(offset, value.into());
    }
}

fn bdtr(main: bool) -> u32 {
    let mut bdtr = BdtrAdv(0);
    bdtr.set_ossi(Ossi::IDLE_LEVEL);
    bdtr.set_ossr(Ossr::IDLE_LEVEL);
    bdtr.set_bkp(0, Bkp::ACTIVE_HIGH);
    bdtr.set_bkf(0, FilterValue::FDTS_DIV16_N6);
    bdtr.set_bke(0, true);
    bdtr.set_dtg(DEAD);
    bdtr.set_moe(main);
    bdtr.0
}

/// Sets it up in the image's order, with all outputs off.
fn set_up() -> Bench<AdvancedTimer> {
    let mut bench = Bench::new(AdvancedTimer::new(), START - 100);
    // Centre-aligned 1, ARPE.
    bench.write(CR1, 0xa0);
    bench.write(CR2, 0x70);
    bench.write(CCER, 0x1000);
    bench.write(BDTR, bdtr(false));
    bench.write(ARR, TOP.into());
    bench.write(CCR4, TRIGGER_AT.into());
    modes(&mut bench, [Ocm::FORCE_INACTIVE; 3]);
    enables(&mut bench, true, false);
    bench.write(CR2, 0x71);
    bench.write(EGR, COMG);
    bench
}

/// Starts it as the image does: updates only at the tops.
fn start(bench: &mut Bench<AdvancedTimer>) {
    bench.until(START);
    bench.write(RCR, 0);
    bench.write(EGR, UG);
    bench.write(CR1, 0xa1);
    bench.write(RCR, 1);
}

/// Returns it running with these compare values, with both switches of all legs.
fn switching(values: [u16; 3]) -> Bench<AdvancedTimer> {
    let mut bench = set_up();
    compares(&mut bench, values);
    // The values are in place before the start, with the gates off.
    bench.write(EGR, UG);
    modes(&mut bench, [Ocm::PWM_MODE1; 3]);
    enables(&mut bench, true, true);
    bench.write(EGR, COMG);
    bench.write(BDTR, bdtr(true));
    start(&mut bench);
    bench.log.clear();
    bench
}

/// Returns a leg's gates: cycles since the start, high, low.
fn gates(bench: &Bench<AdvancedTimer>, wanted: usize) -> Vec<(Cycles, bool, bool)> {
    let of_leg = |(at, signal): &(Cycles, Signal)| match *signal {
        Signal::Gates { leg, high, low } if leg == wanted => Some((at - START, high, low)),
        _ => None,
    };
    bench.log.iter().filter_map(of_leg).collect()
}

fn triggers(bench: &Bench<AdvancedTimer>) -> Vec<Cycles> {
    let trigger =
        |(at, signal): &(Cycles, Signal)| (*signal == Signal::Trigger).then_some(at - START);
    bench.log.iter().filter_map(trigger).collect()
}

#[test]
fn a_half_and_its_extremes_switch_at_their_cycles() {
    let mut bench = switching([0, 500, TOP]);
    bench.until(START + 4000);
    assert_eq!(gates(&bench, 0), []);
    assert_eq!(gates(&bench, 2), []);
    // High around 0, from 500 before to 500 after.
    assert_eq!(
        gates(&bench, 1),
        [
            (500, false, false),
            (520, false, true),
            (1500, false, false),
            (1520, true, false),
            (2500, false, false),
            (2520, false, true),
            (3500, false, false),
            (3520, true, false),
        ]
    );
}

#[test]
fn small_pulses_lose_the_dead_time() {
    // 30 cycles, 16 cycles, and all but 2.
    let mut bench = switching([15, 8, 999]);
    bench.until(START + 1500);
    bench.log.clear();
    bench.until(START + 3500);
    assert_eq!(
        gates(&bench, 0),
        [
            (1985, false, false),
            (2005, true, false),
            (2015, false, false),
            (2035, false, true),
        ]
    );
    assert_eq!(
        gates(&bench, 1),
        [(1992, false, false), (2028, false, true)]
    );
    assert_eq!(
        gates(&bench, 2),
        [(2999, false, false), (3021, true, false)]
    );
}

#[test]
fn the_counter_goes_up_and_down() {
    let mut bench = switching([0; 3]);
    for (after, count, down) in [
        (0, 0, false),
        (999, 999, false),
        (1000, 1000, true),
        (1001, 999, true),
        (1999, 1, true),
        (2000, 0, false),
        (2001, 1, false),
    ] {
        bench.until(START + after);
        assert_eq!(bench.read(CNT), count, "after {after}");
        let dir = Cr1Gp16(bench.read(CR1)).dir();
        assert_eq!(dir == Dir::DOWN, down, "after {after}");
    }
}

#[test]
fn updates_come_at_the_tops() {
    let mut bench = switching([0; 3]);
    let mut updates = Vec::new();
    bench.write(SR, !UIF);
    for after in 1..=5500 {
        bench.until(START + after);
        if bench.read(SR) & UIF != 0 {
            updates.push(after);
            bench.write(SR, !UIF);
        }
    }
    assert_eq!(updates, [1000, 3000, 5000]);
}

#[test]
fn compare_values_are_taken_at_the_top() {
    let mut bench = switching([500; 3]);
    bench.until(START + 1100);
    compares(&mut bench, [200, 500, 500]);
    assert_eq!(bench.read(CCR1), 200);
    bench.until(START + 5000);
    let highs: Vec<_> = gates(&bench, 0)
        .into_iter()
        .filter_map(|(at, high, _)| high.then_some(at))
        .collect();
    // 500 before the first 0, and 200 before the second, each plus the dead time.
    assert_eq!(highs, [1520, 3820]);
}

#[test]
fn the_trigger_comes_at_its_cycle() {
    let mut bench = switching([500; 3]);
    bench.until(START + 5000);
    assert_eq!(triggers(&bench), [975, 2975, 4975]);
}

#[test]
fn modes_and_enables_wait_for_a_commutation() {
    let mut bench = switching([500; 3]);
    bench.until(START + 100);
    modes(&mut bench, [Ocm::FORCE_INACTIVE; 3]);
    enables(&mut bench, true, false);
    bench.until(START + 300);
    assert_eq!(gates(&bench, 0), []);
    bench.write(EGR, COMG);
    bench.until(START + 4000);
    assert_eq!(gates(&bench, 0), [(300, false, false)]);
}

#[test]
fn a_forced_level_changes_the_sides_with_dead_time() {
    let mut bench = switching([500; 3]);
    bench.until(START + 300);
    modes(
        &mut bench,
        [Ocm::FORCE_INACTIVE, Ocm::PWM_MODE1, Ocm::PWM_MODE1],
    );
    bench.write(EGR, COMG);
    bench.until(START + 4000);
    assert_eq!(gates(&bench, 0), [(300, false, false), (320, false, true)]);
}

#[test]
fn between_the_two_pwm_modes_the_reference_stays_until_the_next_comparison() {
    let mut bench = switching([500; 3]);
    bench.until(START + 300);
    modes(&mut bench, [Ocm::PWM_MODE2; 3]);
    bench.write(EGR, COMG);
    bench.until(START + 1400);
    // The comparison ends at 500: the other mode's reference, which applies from then on, is the same.
    assert_eq!(gates(&bench, 0), []);
    bench.until(START + 1600);
    assert_eq!(
        gates(&bench, 0),
        [(1500, false, false), (1520, false, true)]
    );
}

#[test]
fn without_dead_time_the_low_side_alone_is_taken_for_the_high_one() {
    // What the image avoids: from the low side alone to both in one commutation.
    let mut bench = set_up();
    compares(&mut bench, [500; 3]);
    modes(&mut bench, [Ocm::PWM_MODE2; 3]);
    enables(&mut bench, false, true);
    bench.write(EGR, COMG);
    bench.write(BDTR, bdtr(true));
    start(&mut bench);
    bench.until(START + 700);
    bench.log.clear();
    modes(&mut bench, [Ocm::PWM_MODE1; 3]);
    enables(&mut bench, true, true);
    bench.write(EGR, COMG);
    assert_eq!(gates(&bench, 0), [(700, true, false)]);
}

#[test]
fn the_main_output_acts_at_once() {
    let mut bench = switching([500; 3]);
    bench.until(START + 100);
    bench.write(BDTR, bdtr(false));
    bench.until(START + 900);
    bench.write(BDTR, bdtr(true));
    bench.until(START + 1000);
    assert_eq!(gates(&bench, 0), [(100, false, false), (900, false, true)]);
}

#[test]
fn a_break_turns_off_behind_its_filter_and_holds() {
    let mut bench = switching([500; 3]);
    // Samples at multiples of 16; the sixth after 5 is at 96.
    bench.until(START + 5);
    bench.with(|timer, context| timer.set_break(true, context));
    bench.until(START + 95);
    assert_eq!(gates(&bench, 0), []);
    bench.until(START + 200);
    assert_eq!(gates(&bench, 0), [(96, false, false)]);
    assert_eq!(bench.read(BDTR) & MOE, 0);
    bench.write(SR, !BIF);
    assert_eq!(bench.read(SR) & BIF, BIF);
    bench.write(BDTR, bdtr(true));
    assert_eq!(bench.read(BDTR) & MOE, 0);
    // The sixth after 200 is at 288.
    bench.with(|timer, context| timer.set_break(false, context));
    bench.until(START + 287);
    bench.write(BDTR, bdtr(true));
    assert_eq!(bench.read(BDTR) & MOE, 0);
    bench.until(START + 288);
    assert_eq!(bench.read(BDTR) & MOE, 0);
    bench.write(SR, !BIF);
    assert_eq!(bench.read(SR) & BIF, 0);
    bench.write(BDTR, bdtr(true));
    assert_eq!(gates(&bench, 0), [(96, false, false), (288, true, false)]);
}

#[test]
fn a_short_break_vanishes() {
    let mut bench = switching([500; 3]);
    bench.until(START + 5);
    bench.with(|timer, context| timer.set_break(true, context));
    bench.until(START + 90);
    bench.with(|timer, context| timer.set_break(false, context));
    bench.until(START + 400);
    assert_eq!(gates(&bench, 0), []);
    assert_eq!(bench.read(SR) & BIF, 0);
}

#[test]
fn the_comparators_that_break_are_told() {
    let mut bench = set_up();
    assert_eq!(bench.part.break_comparators(), [false; 3]);
    bench.write(AF1, 0x12);
    assert_eq!(bench.part.break_comparators(), [true, false, true]);
}

#[test]
fn a_reset_turns_the_gates_off() {
    let mut bench = switching([500; 3]);
    bench.until(START + 100);
    bench.with(AdvancedTimer::reset);
    assert_eq!(gates(&bench, 0), [(100, false, false)]);
    assert_eq!(bench.part.due(), NEVER);
    assert_eq!(bench.read(ARR), 0xffff);
}

#[test]
fn duties_that_change_every_period_keep_the_dead_time() {
    let mut bench = switching([500; 3]);
    let mut watch = Bridge::new(DEAD.into());
    let mut duty = 12_345_u32;
    for period in 1..2000 {
        bench.until(START + 2000 * period - 800);
        let mut next = || {
            duty = duty.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // Sometimes all or nothing.
            ((duty >> 16) % 1400).saturating_sub(200).min(TOP.into()) as u16
        };
        let values = [next(), next(), next()];
        compares(&mut bench, values);
    }
    for (at, signal) in &bench.log {
        if let Signal::Gates { leg, high, low } = *signal {
            watch.gates(leg, high, low, *at);
        }
    }
    assert!(watch.edges() > 10_000);
    assert_eq!(watch.first(), []);
}

#[test]
fn what_is_not_followed_is_refused() {
    let mut bench = set_up();
    for (offset, value) in [
        (DIER, 1),
        (PSC, 1),
        (ARR, 0),
        (ARR, 0x1_0000),
        // Centre-aligned 2, one pulse, a divided dead-time clock.
        (CR1, 0xc0),
        (CR1, 0xa8),
        (CR1, 0x1a0),
        // A high idle level; the commutation preload turned off.
        (CR2, 0x171),
        (CR2, 0x70),
        (CCER, 0x2),
        // Toggle; fast enable; an input.
        (CCMR1, 0x30),
        (CCMR1, 0x4),
        (CCMR1, 0x1),
        // Automatic output enable; a lock.
        (BDTR, 1 << 14),
        (BDTR, 1 << 8),
        (AF1, 1),
        (EGR, 1 << 7),
        (0x08, 0),
        (CNT, 5),
    ] {
        let result = bench.try_write(offset, value);
        assert_eq!(result, Err(Unmodelled), "{offset:#x} {value:#x}");
    }
    let read = bench.with(|timer, context| timer.read(0x54, context));
    assert_eq!(read, Err(Unmodelled));
}
