//! Answers to successive frames, as a flight controller reads them.

use siskin_params::{BOSSO_MOTOR, Board, Params};

use super::*;
use crate::build::build;
use crate::drive::State;
use core::num::NonZeroU32;
use std::vec::Vec;

const TICK_HZ: u32 = 170_000_000;

struct Rig {
    answers: Answers,
    basis: Basis,
    snapshot: Snapshot,
    telemetry: Telemetry,
    now_ticks: u32,
}

impl Rig {
    fn new() -> Self {
        let config = build(&Params::of(&BOSSO_MOTOR), &Board::BENCH).expect("the defaults fit");
        Self {
            answers: Answers::new(TICK_HZ),
            snapshot: State::new(&config).snapshot(),
            basis: Basis::new(config.scale),
            telemetry: Telemetry {
                temperature_c: 40.6,
                bus_v: 23.9,
                bus_a: 12.4,
                ..Telemetry::new()
            },
            // The timer wraps within the first millisecond.
            now_ticks: 0_u32.wrapping_sub(100_000),
        }
    }

    fn ask(&mut self, after_us: u32, rate: Rate, bidirectional: bool, telemetry: bool) -> Answer {
        self.now_ticks = self
            .now_ticks
            .wrapping_add(after_us * (TICK_HZ / 1_000_000));
        let ask = Ask {
            first_edge_ticks: self.now_ticks,
            frame_ticks: None,
            rate,
            bidirectional,
            telemetry,
        };
        let answers = &mut self.answers;
        let speed_bits = speed_bits(&self.snapshot, &self.basis);
        let reply = answers.reply(ask, speed_bits, &self.telemetry);
        let Serial { kiss, info } =
            answers.serial(ask, &self.snapshot, &self.basis, &self.telemetry);
        Answer { reply, kiss, info }
    }

    /// Returns the data of the reply to the next frame.
    fn data(&mut self, after_us: u32) -> u16 {
        let answer = self.ask(after_us, Rate::Dshot600, true, false);
        gcr::decode(answer.reply.expect("asked for").bits).expect("a reply")
    }
}

#[test]
fn the_reply_begins_30_us_after_sixteen_bits_at_every_rate_and_timer() {
    for tick_hz in [170_000_000, 84_000_000, 8_000_000] {
        let mut rig = Rig::new();
        rig.answers = Answers::new(tick_hz);
        for (rate, bit_hz) in Rate::ALL
            .into_iter()
            .zip([187_500, 375_000, 750_000, 1_500_000])
        {
            let reply = rig.ask(1000, rate, true, false).reply.expect("asked for");
            assert_eq!(reply.bit_hz, bit_hz);
            let ticks = reply.at_ticks.wrapping_sub(rig.now_ticks);
            let exact_s = 16.0 / f64::from(rate.bit_hz()) + 30e-6;
            assert!((f64::from(ticks) - exact_s * f64::from(tick_hz)).abs() <= 0.5);
        }
    }
}

#[test]
fn a_sender_whose_clock_is_off_is_answered_by_it() {
    let mut rig = Rig::new();
    for bit in [0.8, 1.114, 1.33] {
        let frame_s = 16.0 * bit / 600e3;
        let frame_ticks = (frame_s * f64::from(TICK_HZ)) as u32;
        let ask = Ask {
            first_edge_ticks: rig.now_ticks,
            frame_ticks: NonZeroU32::new(frame_ticks),
            rate: Rate::Dshot600,
            bidirectional: true,
            telemetry: false,
        };
        let reply = rig
            .answers
            .reply(ask, 0, &rig.telemetry)
            .expect("asked for");
        assert!((f64::from(reply.bit_hz) * bit / 750e3 - 1.0).abs() < 1e-3);
        let ticks = reply.at_ticks.wrapping_sub(rig.now_ticks);
        let exact_s = frame_s + 30e-6;
        assert!((f64::from(ticks) - exact_s * f64::from(TICK_HZ)).abs() <= 2.0);
    }
}

#[test]
fn what_is_asked_for_is_answered_and_nothing_else() {
    let mut rig = Rig::new();
    let mut asked = |bidirectional, telemetry| {
        let answer = rig.ask(2000, Rate::Dshot300, bidirectional, telemetry);
        assert_eq!(answer.info, None);
        (answer.reply.is_some(), answer.kiss.is_some())
    };
    for bidirectional in [false, true] {
        for telemetry in [false, true] {
            assert_eq!(asked(bidirectional, telemetry), (bidirectional, telemetry));
        }
    }
    rig.answers.send_info([7; info::BYTES]);
    assert_eq!(
        rig.ask(2000, Rate::Dshot300, false, false).info,
        Some([7; info::BYTES])
    );
    assert_eq!(rig.ask(2000, Rate::Dshot300, false, false).info, None);
}

#[test]
fn serial_telemetry_waits_until_its_line_is_free() {
    let mut rig = Rig::new();
    let sent = (0..8000).filter(|_| {
        let answer = rig.ask(125, Rate::Dshot600, true, true);
        answer.kiss.is_some()
    });
    assert_eq!(sent.count(), 1000);
}

#[test]
fn the_information_has_the_serial_line_for_itself() {
    let mut rig = Rig::new();
    rig.ask(1000, Rate::Dshot600, false, true);
    rig.answers.send_info([7; info::BYTES]);
    // 10 bits per byte at 115200 baud.
    let length_us = |bytes: usize| (bytes as u32 * 10 * 1_000_000).div_ceil(115_200);
    let mut free_us = length_us(kiss::BYTES);
    let (mut infos_us, mut kisses_us) = (Vec::new(), Vec::new());
    for at_us in (250..10_000).step_by(250) {
        let Answer { kiss, info, .. } = rig.ask(250, Rate::Dshot600, false, true);
        let bytes = info.map_or(0, |info| info.len()) + kiss.map_or(0, |kiss| kiss.len());
        if bytes > 0 {
            assert!(at_us >= free_us, "{at_us} µs: the line is not free");
            free_us = at_us + length_us(bytes);
        }
        infos_us.extend(info.map(|_| at_us));
        kisses_us.extend(kiss.map(|_| at_us));
    }
    assert_eq!(infos_us, [1000]);
    assert_eq!(kisses_us, [7000, 8000, 9000]);
}

#[test]
fn without_extended_telemetry_every_reply_is_the_speed() {
    let mut rig = Rig::new();
    rig.snapshot.speed = rig.basis.scale.speed_from_rpm(-3000.0);
    for _ in 0..20_000 {
        // 36000 eRPM: 1667 µs per turn, to the nearest 4.
        assert_eq!(erpm::period_us(rig.data(125)), Some(1668));
    }
}

#[test]
fn extended_telemetry_is_announced_told_and_ended() {
    let mut rig = Rig::new();
    assert_eq!(rig.data(125), erpm::STOPPED);
    rig.answers.set_extended(true);
    assert_eq!(rig.data(125), 0xE00);
    let second: Vec<u16> = (0..8000).map(|_| rig.data(125)).collect();
    assert!(second.windows(2).all(|two| two.contains(&erpm::STOPPED)));
    let count = |word| second.iter().filter(|data| **data == word).count();
    for (word, times) in [
        (Extended::Status(0), 2),
        (Extended::Temperature(41), 2),
        (Extended::Voltage(96), 4),
        (Extended::Current(12), 4),
        (Extended::Stress(0), 4),
    ] {
        assert_eq!(count(word.data()), times, "{word:?}");
    }
    assert_eq!(count(erpm::STOPPED), 8000 - 16);

    rig.answers.set_extended(false);
    let after: Vec<u16> = (0..8000).map(|_| rig.data(125)).collect();
    let others: Vec<_> = after
        .iter()
        .filter(|data| **data != erpm::STOPPED)
        .collect();
    assert_eq!(others, [&0xEFF]);
}

#[test]
fn with_the_signal_all_that_was_asked_for_is_forgotten() {
    let mut rig = Rig::new();
    rig.answers.set_extended(true);
    assert_eq!(rig.data(125), 0xE00);
    rig.answers.set_extended(true);
    rig.answers.send_info([7; info::BYTES]);
    rig.answers.lost();
    assert!((0..8000).all(|_| rig.data(125) == erpm::STOPPED));
    assert_eq!(rig.ask(2000, Rate::Dshot300, false, true).info, None);
    // A new request gets it.
    rig.answers.set_extended(true);
    assert_eq!(rig.data(125), 0xE00);
}

#[test]
fn an_announcement_does_not_follow_an_extended_word_at_once() {
    let mut rig = Rig::new();
    rig.answers.set_extended(true);
    assert_eq!(rig.data(125), 0xE00);
    rig.answers.set_extended(false);
    assert_eq!(rig.data(125), erpm::STOPPED);
    assert_eq!(rig.data(125), 0xEFF);
}

#[test]
fn what_does_not_fit_stays_at_the_end_of_its_range() {
    let mut rig = Rig::new();
    rig.telemetry = Telemetry {
        temperature_c: -20.0,
        bus_v: 70.0,
        bus_a: -5.0,
        ..Telemetry::new()
    };
    rig.answers.set_extended(true);
    let second: Vec<u16> = (0..8000).map(|_| rig.data(125)).collect();
    for word in [
        Extended::Temperature(0),
        Extended::Voltage(255),
        Extended::Current(0),
    ] {
        assert!(second.contains(&word.data()), "{word:?}");
    }
}
