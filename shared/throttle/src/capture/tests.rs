//! The decoder on frames at their tolerances, and on edges that are not frames.

use super::*;
use crate::dshot::edges;
use proptest::prelude::*;
use std::vec::Vec;

const TICK_HZ: u32 = 170_000_000;

/// Value 1046 with telemetry.
const WORD: u16 = 0x82D7;

/// Edges in ns since the start, as ticks of a timer that started at `offset`.
struct Wire {
    decoder: Decoder,
    tick_hz: u32,
    offset: u32,
    bidirectional: bool,
    now_ns: f64,
}

impl Wire {
    fn new(tick_hz: u32, bidirectional: bool) -> Self {
        Self {
            decoder: Decoder::new(tick_hz),
            tick_hz,
            offset: 0,
            bidirectional,
            now_ns: 0.0,
        }
    }

    fn ticks(&self, at_ns: f64) -> u32 {
        let ticks = (at_ns * f64::from(self.tick_hz) / 1e9) as u64;
        self.offset.wrapping_add(ticks as u32)
    }

    fn edge(&mut self, at_ns: f64, active: bool) -> Option<Event> {
        self.decoder
            .edge(self.ticks(at_ns), active != self.bidirectional)
    }

    fn settle(&mut self) -> Option<Event> {
        self.decoder.settle(self.ticks(self.now_ns))
    }

    /// Plays active levels and rests of these durations, alternating.
    fn durations(&mut self, durations_ns: &[f64]) -> Vec<Option<Event>> {
        let played = durations_ns.iter().enumerate();
        let played = played.map(|(place, duration_ns)| {
            let event = self.edge(self.now_ns, place % 2 == 0);
            self.now_ns += duration_ns;
            event
        });
        played.collect()
    }

    /// Plays a normal frame's bits, as this wire has them, at `speed` times the rate, then 2 bits of pause.
    fn frame(&mut self, bits: u16, rate: Rate, speed: f64) -> Vec<Option<Event>> {
        let start_ns = self.now_ns;
        self.now_ns += f64::from(rate.frame_ns() + 2 * rate.bit_ns()) / speed;
        edges(bits ^ self.check(), rate)
            .map(|(at_ns, active)| self.edge(start_ns + f64::from(at_ns) / speed, active))
            .collect()
    }

    fn check(&self) -> u16 {
        check_mask(self.bidirectional)
    }

    /// Returns the event for a frame of these bits whose first edge came at `start_ns`.
    fn wanted(&self, bits: u16, rate: Rate, start_ns: f64) -> Option<Event> {
        Frame::from_bits(bits).map(|frame| Event::Frame {
            rate,
            bidirectional: self.bidirectional,
            frame,
            first_edge_ticks: self.ticks(start_ns),
            frame_ticks: None,
        })
    }

    /// Returns true if a frame of `WORD` is reported at its last edge, and nothing before.
    fn finds(&mut self, rate: Rate) -> bool {
        let wanted = self.wanted(WORD, rate, self.now_ns);
        at_the_end(&self.frame(WORD, rate, 1.0), wanted)
    }
}

/// Returns true if nothing came but this event at the end.
fn at_the_end(events: &[Option<Event>], wanted: Option<Event>) -> bool {
    let (last, before) = events.split_last().expect("edges were played");
    *last == wanted && before.iter().all(Option::is_none)
}

fn is_frame(event: &Event) -> bool {
    matches!(event, Event::Frame { .. })
}

/// Returns the durations of highs and lows in a normal frame of `WORD`, with a long last low.
fn word_ns(rate: Rate) -> Vec<f64> {
    let edges: Vec<_> = edges(WORD, rate)
        .map(|(at_ns, _)| f64::from(at_ns))
        .collect();
    let mut durations: Vec<_> = edges.windows(2).map(|pair| pair[1] - pair[0]).collect();
    durations.push(200_000.0);
    durations
}

#[test]
fn a_frame_comes_with_its_last_edge_and_back_to_back() {
    for rate in Rate::ALL {
        for bidirectional in [false, true] {
            let mut wire = Wire::new(TICK_HZ, bidirectional);
            for _ in 0..5 {
                assert!(wire.finds(rate), "{rate:?} {bidirectional}");
            }
        }
    }
}

#[test]
fn rates_may_change_from_frame_to_frame() {
    let mut wire = Wire::new(TICK_HZ, false);
    for rate in Rate::ALL.into_iter().chain(Rate::ALL.into_iter().rev()) {
        assert!(wire.finds(rate), "{rate:?}");
        wire.now_ns += 10_000.0;
    }
}

#[test]
fn what_alone_is_taken_is_the_only_one() {
    for only in Rate::ALL {
        for both in [[false, false], [false, true], [true, false], [true, true]] {
            let [only_bidirectional, bidirectional] = both;
            let mut wire = Wire::new(TICK_HZ, bidirectional);
            wire.decoder.take_only(Some((only, only_bidirectional)));
            for rate in Rate::ALL {
                let taken = rate == only && bidirectional == only_bidirectional;
                assert_eq!(wire.finds(rate), taken, "{rate:?} {only:?} {both:?}");
                wire.now_ns += 200_000.0;
                wire.settle();
            }
            wire.decoder.take_only(None);
            for rate in Rate::ALL {
                assert!(wire.finds(rate));
                wire.now_ns += 200_000.0;
            }
        }
    }
}

#[test]
fn slow_timers_take_what_they_can_tell_apart() {
    for (tick_hz, taken) in [
        (14_400_000, 4),
        (14_399_999, 3),
        (7_200_000, 3),
        (7_199_999, 2),
        (3_600_000, 2),
        (1_800_000, 1),
        (1_799_999, 0),
        (0, 0),
    ] {
        for (place, rate) in Rate::ALL.into_iter().enumerate() {
            let events = Wire::new(tick_hz, false).durations(&word_ns(rate));
            let frame = events.iter().flatten().any(is_frame);
            assert_eq!(frame, place < taken, "{tick_hz} {rate:?}");
        }
    }
}

#[test]
fn a_clock_that_is_off_is_taken_and_measured() {
    for rate in Rate::ALL {
        for bit in [0.76, 0.9, 0.96, 0.98, 1.0, 1.02, 1.04, 1.114, 1.2, 1.34] {
            let events = Wire::new(TICK_HZ, false).frame(WORD, rate, 1.0 / bit);
            let Some(Some(Event::Frame {
                rate: found,
                frame_ticks,
                ..
            })) = events.last()
            else {
                panic!("{rate:?} {bit}: {events:?}");
            };
            assert_eq!(*found, rate, "{bit}");
            let is_off = f64::abs(bit - 1.0) > 0.03;
            assert_eq!(frame_ticks.is_some(), is_off, "{rate:?} {bit}");
            if let Some(ticks) = frame_ticks {
                let frame_ns = f64::from(ticks.get()) * 1e9 / f64::from(TICK_HZ);
                let error = frame_ns / (f64::from(rate.frame_ns()) * bit) - 1.0;
                assert!(error.abs() < 0.01, "{rate:?} {bit}: {error}");
            }
        }
    }
}

#[test]
fn clocks_between_two_rates_are_refused() {
    for rate in Rate::ALL {
        for bit in [0.73, 1.38] {
            let events = Wire::new(TICK_HZ, false).frame(WORD, rate, 1.0 / bit);
            assert!(at_the_end(&events, Some(Event::Bad)), "{rate:?} {bit}");
        }
    }
}

#[test]
fn wrong_numbers_of_pulses_are_bad_once_for_sixteen() {
    for rate in Rate::ALL {
        for pulses in 1..40 {
            // A zero and then ones: the checksum of the first 16 is wrong.
            let bit_ns = f64::from(rate.bit_ns());
            let mut burst = [0.75 * bit_ns, 0.25 * bit_ns].repeat(pulses);
            burst[0] = 0.375 * bit_ns;
            burst[1] = 0.625 * bit_ns;
            let mut wire = Wire::new(TICK_HZ, false);
            let mut events = wire.durations(&burst);
            wire.now_ns += 200_000.0;
            events.push(wire.settle());
            assert_eq!(wire.settle(), None);
            assert!(events.iter().flatten().all(|&event| event == Event::Bad));
            let bad = events.iter().flatten().count();
            assert_eq!(bad, pulses.div_ceil(16), "{rate:?} {pulses}");
            assert!(wire.finds(rate), "{rate:?} {pulses}");
        }
    }
}

#[test]
fn a_pulse_after_a_frame_is_bad_once() {
    for rate in Rate::ALL {
        let mut wire = Wire::new(TICK_HZ, false);
        assert!(wire.finds(rate));
        wire.now_ns -= 2.0 * f64::from(rate.bit_ns());
        assert!(
            wire.durations(&[1250.0, 200_000.0])
                .iter()
                .all(Option::is_none)
        );
        assert_eq!(wire.settle(), Some(Event::Bad));
        assert_eq!(wire.settle(), None);
        assert!(wire.finds(rate));
    }
}

#[test]
fn a_frame_that_is_cut_is_bad_once_the_line_rests() {
    for rate in Rate::ALL {
        for edges in 1..32 {
            let mut wire = Wire::new(TICK_HZ, false);
            wire.decoder.take_only(Some((rate, false)));
            let mut burst = word_ns(rate);
            burst.truncate(edges);
            assert!(wire.durations(&burst).iter().all(Option::is_none));
            wire.now_ns += 1.5 * f64::from(rate.bit_ns());
            assert_eq!(wire.settle(), Some(Event::Bad), "{rate:?} {edges}");
            assert_eq!(wire.settle(), None);
        }
    }
}

#[test]
fn widths_that_no_bit_has_are_bad_once() {
    for rate in Rate::ALL {
        for pulse in 0..16 {
            for share in [0.05, 0.15, 0.97] {
                let mut burst = word_ns(rate);
                let active_ns = share * f64::from(rate.bit_ns());
                burst[pulse * 2 + 1] += burst[pulse * 2] - active_ns;
                burst[pulse * 2] = active_ns;
                let mut wire = Wire::new(TICK_HZ, false);
                let events = wire.durations(&burst);
                assert!(
                    at_the_end(&events, Some(Event::Bad)),
                    "{rate:?} {pulse} {share}"
                );
                assert!(wire.finds(rate));
            }
        }
    }
}

#[test]
fn levels_and_check_sum_belong_together() {
    for rate in Rate::ALL {
        for bidirectional in [false, true] {
            let mut wire = Wire::new(TICK_HZ, bidirectional);
            for _ in 0..10 {
                let events = wire.frame(WORD ^ check_mask(true), rate, 1.0);
                assert!(at_the_end(&events, Some(Event::Bad)), "{rate:?}");
            }
        }
    }
}

#[test]
fn servo_pulses_are_no_frames() {
    let mut wire = Wire::new(TICK_HZ, false);
    let events = wire.durations(&[1.5e6, 18.5e6].repeat(100));
    assert!(!events.iter().flatten().any(is_frame));
    assert!(!wire.finds(Rate::Dshot300), "a rest was bad before it");
    assert!(wire.finds(Rate::Dshot300));
}

#[test]
fn a_stream_is_found_from_its_middle() {
    // DShot600 at 32 kHz leaves 4.6 µs between frames, less than one bit of DShot150.
    for skipped in 0..32 {
        let mut wire = Wire::new(TICK_HZ, false);
        for (at_ns, level) in edges(WORD, Rate::Dshot600).skip(skipped) {
            wire.edge(f64::from(at_ns), level);
        }
        wire.now_ns = 31_250.0;
        let events = wire.frame(WORD, Rate::Dshot600, 1.0);
        let found = events.iter().flatten().filter(|event| is_frame(event));
        assert_eq!(found.count(), 1, "{skipped}");
        assert!(
            events[31].is_some_and(|event| is_frame(&event)),
            "{skipped}"
        );
    }
}

#[test]
fn a_missed_edge_spoils_one_frame() {
    for missed in 0..32 {
        let mut wire = Wire::new(TICK_HZ, false);
        for (place, &(at_ns, level)) in edges(WORD, Rate::Dshot600)
            .collect::<Vec<_>>()
            .iter()
            .enumerate()
        {
            if place == missed {
                continue;
            }
            let event = if place == missed + 1 {
                wire.decoder.spoil(wire.ticks(f64::from(at_ns)));
                None
            } else {
                wire.edge(f64::from(at_ns), level)
            };
            assert_eq!(event, None, "{missed}");
        }
        wire.now_ns = 50_000.0;
        assert_eq!(wire.settle(), Some(Event::Bad), "{missed}");
        if missed == 31 {
            // The line seems high until the next frame's first edge, which brings no new level, yet is that
            // frame's first edge.
            let start_ns = wire.now_ns;
            let wanted = wire.wanted(WORD, Rate::Dshot600, start_ns);
            let played: Vec<_> = edges(WORD, Rate::Dshot600).collect();
            wire.decoder.spoil(wire.ticks(start_ns));
            let events: Vec<_> = played[1..]
                .iter()
                .map(|&(at_ns, level)| wire.edge(start_ns + f64::from(at_ns), level))
                .collect();
            assert!(at_the_end(&events, wanted));
            wire.now_ns = 100_000.0;
        }
        assert!(wire.finds(Rate::Dshot600), "{missed}");
    }
}

/// Rates, with timers that can tell their bits apart despite 60 ns of jitter.
fn rates_and_timers() -> impl Strategy<Value = (Rate, u32)> {
    let fast = prop_oneof![Just(TICK_HZ), Just(84_000_000), 84_000_000_u32..=u32::MAX];
    let slow = prop_oneof![Just(7_200_000), 7_200_000_u32..=84_000_000];
    prop_oneof![
        (prop::sample::select(&Rate::ALL[..]), fast),
        (prop::sample::select(&Rate::ALL[..3]), slow),
    ]
}

/// Edge displacements, ns, often at their limits.
fn jitters() -> impl Strategy<Value = Vec<f64>> {
    let one = prop_oneof![Just(-60.0), Just(60.0), -60.0..60.0];
    prop::collection::vec(one, 32)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn frames_are_decoded_in_spite_of_jitter(
        (rate, tick_hz) in rates_and_timers(),
        bidirectional: bool,
        alone: bool,
        offset: u32,
        speed in prop_oneof![Just(0.95), Just(1.05), 0.95..1.05],
        sent in prop::collection::vec((0_u16..=2047, any::<bool>(), jitters()), 1..8),
    ) {
        let mut wire = Wire::new(tick_hz, bidirectional);
        wire.decoder.take_only(alone.then_some((rate, bidirectional)));
        wire.offset = offset;
        for (value, telemetry, jitter_ns) in sent {
            let bits = Frame { value, telemetry }.to_bits();
            let start_ns = wire.now_ns + 100.0;
            wire.now_ns += f64::from(rate.frame_ns() + 2 * rate.bit_ns()) / speed;
            let wanted = wire.wanted(bits, rate, start_ns + jitter_ns[0]);
            let mut events: Vec<_> = edges(bits ^ wire.check(), rate)
                .zip(jitter_ns)
                .map(|((at_ns, active), jitter_ns)| {
                    wire.edge(start_ns + f64::from(at_ns) / speed + jitter_ns, active)
                })
                .collect();
            if let Some(Some(Event::Frame { frame_ticks, .. })) = events.last_mut() {
                *frame_ticks = None;
            }
            prop_assert!(at_the_end(&events, wanted), "{events:?}");
        }
    }

    #[test]
    fn any_edges_are_taken(
        tick_hz: u32,
        only in prop::option::of((prop::sample::select(&Rate::ALL[..]), any::<bool>())),
        edges in prop::collection::vec(
            (prop_oneof![Just(0), 0_u32..3000, any::<u32>()], 0..20),
            0..200,
        ),
    ) {
        let mut decoder = Decoder::new(tick_hz);
        decoder.take_only(only);
        let mut at = 0_u32;
        let mut level = false;
        for (step, kind) in edges {
            at = at.wrapping_add(step);
            match kind {
                0 => decoder.spoil(at),
                1 => decoder.clear(),
                2 => {
                    decoder.settle(at);
                }
                _ => {
                    level = !level;
                    decoder.edge(at, level);
                }
            }
        }
    }
}
