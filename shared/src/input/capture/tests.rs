//! The decoder against frames that stray, and against what is no frame.

use super::*;
use crate::input::dshot::edges;
use proptest::prelude::*;
use std::vec::Vec;

const TICK_HZ: u32 = 170_000_000;

/// Edges at nanoseconds since the start, in ticks of a timer that began at `offset`.
struct Wire {
    decoder: Decoder,
    tick_hz: u32,
    offset: u32,
    now_ns: f64,
}

impl Wire {
    fn new(tick_hz: u32) -> Self {
        Self {
            decoder: Decoder::new(tick_hz),
            tick_hz,
            offset: 0,
            now_ns: 0.0,
        }
    }

    fn edge(&mut self, at_ns: f64, level: bool) -> Option<Event> {
        let ticks = (at_ns * f64::from(self.tick_hz) / 1e9) as u64;
        self.decoder
            .edge(self.offset.wrapping_add(ticks as u32), level)
    }

    /// Plays levels of these durations, the first one being `level`, and what they gave.
    fn durations(&mut self, mut level: bool, durations_ns: &[f64]) -> Vec<Option<Event>> {
        let played = durations_ns.iter().map(|duration_ns| {
            let event = self.edge(self.now_ns, level);
            self.now_ns += duration_ns;
            level = !level;
            event
        });
        played.collect()
    }

    /// Plays a frame at `speed` times its rate, and 2 bits of pause.
    fn frame(&mut self, bits: u16, rate: Rate, speed: f64) -> Vec<Option<Event>> {
        let start_ns = self.now_ns;
        self.now_ns += f64::from(rate.frame_ns() + 2 * rate.bit_ns()) / speed;
        edges(bits, rate)
            .map(|(at_ns, level)| self.edge(start_ns + f64::from(at_ns) / speed, level))
            .collect()
    }
}

/// Nothing, but this event at the end.
fn at_the_end(events: &[Option<Event>], wanted: Option<Event>) -> bool {
    let (last, before) = events.split_last().expect("edges were played");
    *last == wanted && before.iter().all(Option::is_none)
}

fn all(rate: Rate) -> Option<Event> {
    Frame::from_bits(WORD).map(|frame| Event::Frame { rate, frame })
}

/// Value 1046 with telemetry.
const WORD: u16 = 0x82D7;

/// Durations of pulses and lows of a frame of `WORD`, the last low being long.
fn word_ns(rate: Rate) -> Vec<f64> {
    let edges: Vec<_> = edges(WORD, rate)
        .map(|(at_ns, _)| f64::from(at_ns))
        .collect();
    let mut durations: Vec<_> = edges.windows(2).map(|pair| pair[1] - pair[0]).collect();
    durations.push(200_000.0);
    durations
}

#[test]
fn a_frame_comes_with_its_last_edge() {
    for rate in Rate::ALL {
        let mut wire = Wire::new(TICK_HZ);
        for _ in 0..3 {
            assert!(
                at_the_end(&wire.frame(WORD, rate, 1.0), all(rate)),
                "{rate:?}"
            );
        }
    }
}

#[test]
fn rates_may_change_from_frame_to_frame() {
    let mut wire = Wire::new(TICK_HZ);
    for rate in Rate::ALL.into_iter().chain(Rate::ALL.into_iter().rev()) {
        assert!(
            at_the_end(&wire.frame(WORD, rate, 1.0), all(rate)),
            "{rate:?}"
        );
    }
}

#[test]
fn a_forced_rate_is_the_only_one() {
    for forced in Rate::ALL {
        let mut wire = Wire::new(TICK_HZ);
        wire.decoder.force(Some(forced));
        for rate in Rate::ALL {
            let events = wire.durations(true, &word_ns(rate));
            let frames = events
                .iter()
                .flatten()
                .filter(|&&event| event != Event::BadFrame);
            assert_eq!(
                frames.count(),
                usize::from(rate == forced),
                "{rate:?} {forced:?}"
            );
        }
        wire.decoder.force(None);
        for rate in Rate::ALL {
            let events = wire.durations(true, &word_ns(rate));
            assert_eq!(events.last(), Some(&all(rate)));
        }
    }
}

#[test]
fn slow_timers_take_what_they_can_tell_apart() {
    for (tick_hz, taken) in [
        (7_200_000, 3),
        (7_199_999, 2),
        (3_600_000, 2),
        (1_800_000, 1),
        (1_799_999, 0),
        (0, 0),
    ] {
        for (place, rate) in Rate::ALL.into_iter().enumerate() {
            let mut wire = Wire::new(tick_hz);
            let events = wire.durations(true, &word_ns(rate));
            let frame = events
                .iter()
                .flatten()
                .any(|&event| event != Event::BadFrame);
            assert_eq!(frame, place < taken, "{tick_hz} {rate:?}");
        }
    }
}

#[test]
fn clocks_far_off_are_refused() {
    for rate in Rate::ALL {
        for speed in [0.90, 1.11] {
            let mut wire = Wire::new(TICK_HZ);
            let events = wire.frame(WORD, rate, speed);
            assert!(
                at_the_end(&events, Some(Event::BadFrame)),
                "{rate:?} {speed}"
            );
        }
    }
}

#[test]
fn wrong_numbers_of_pulses_are_bad_once() {
    for rate in Rate::ALL {
        for pulses in 1..40 {
            // A zero and then ones: the check sum of the first 16 is wrong.
            let bit_ns = f64::from(rate.bit_ns());
            let mut burst = [0.75 * bit_ns, 0.25 * bit_ns].repeat(pulses);
            burst[0] = 0.375 * bit_ns;
            burst[1] = 0.625 * bit_ns;
            *burst.last_mut().expect("two a pulse") = 200_000.0;
            let mut wire = Wire::new(TICK_HZ);
            let mut events = wire.durations(true, &burst);
            events.extend(wire.durations(true, &word_ns(rate)));
            let events: Vec<_> = events.into_iter().flatten().collect();
            assert_eq!(events.len(), 2, "{rate:?} {pulses}");
            assert_eq!(events[0], Event::BadFrame);
            assert_eq!(Some(events[1]), all(rate));
        }
    }
}

#[test]
fn a_pulse_after_a_frame_is_bad_once() {
    let mut burst = word_ns(Rate::Dshot600);
    *burst.last_mut().expect("not empty") = 417.0;
    burst.extend([1250.0, 417.0].repeat(20));
    let mut wire = Wire::new(TICK_HZ);
    let events: Vec<_> = wire.durations(true, &burst).into_iter().flatten().collect();
    assert_eq!(
        events[..],
        [all(Rate::Dshot600).expect("valid"), Event::BadFrame]
    );
}

#[test]
fn widths_that_no_bit_has_are_bad_once() {
    for rate in Rate::ALL {
        for pulse in 0..16 {
            // A first pulse that is too short is a disturbance before a frame that lacks one: two.
            let shares = if pulse == 0 {
                &[0.97][..]
            } else {
                &[0.05, 0.15, 0.97]
            };
            for share in shares {
                let mut burst = word_ns(rate);
                let high_ns = share * f64::from(rate.bit_ns());
                burst[pulse * 2 + 1] += burst[pulse * 2] - high_ns;
                burst[pulse * 2] = high_ns;
                let mut wire = Wire::new(TICK_HZ);
                let mut events = wire.durations(true, &burst);
                events.extend(wire.durations(true, &word_ns(rate)));
                let events: Vec<_> = events.into_iter().flatten().collect();
                assert_eq!(
                    events[..],
                    [Event::BadFrame, all(rate).expect("valid")],
                    "{rate:?} {pulse} {share}"
                );
            }
        }
    }
}

#[test]
fn an_inverted_line_is_bad_once_a_frame() {
    for rate in Rate::ALL {
        let mut wire = Wire::new(TICK_HZ);
        wire.decoder.edge(0, true);
        wire.now_ns = 100_000.0;
        for _ in 0..10 {
            let events = wire.durations(false, &word_ns(rate));
            assert_eq!(events[0], Some(Event::BadFrame));
            assert!(events[1..].iter().all(Option::is_none));
        }
    }
}

#[test]
fn servo_pulses_are_bad_once_a_pulse() {
    let mut wire = Wire::new(TICK_HZ);
    let events = wire.durations(true, &[1.5e6, 18.5e6].repeat(10));
    assert_eq!(events.iter().flatten().count(), 10);
    assert!(at_the_end(
        &wire.frame(WORD, Rate::Dshot300, 1.0),
        all(Rate::Dshot300)
    ));
}

#[test]
fn noise_without_a_rest_is_bad_once() {
    // No low reaches 1.5 bits of the fastest rate, however much longer than the last it is.
    let burst = [100.0, 150.0, 80.0, 2_200.0].repeat(50);
    let mut wire = Wire::new(TICK_HZ);
    let events = wire.durations(true, &burst);
    assert_eq!(events.iter().flatten().count(), 1);
    wire.now_ns += 200_000.0;
    let events = wire.frame(WORD, Rate::Dshot300, 1.0);
    assert!(at_the_end(&events, all(Rate::Dshot300)));
}

#[test]
fn a_stream_is_found_from_its_middle() {
    // 32 kHz of DShot600 leave 4.6 µs between frames, less than one bit of DShot150. What comes
    // first may be the end of a pulse, whose width says nothing: one frame may be lost to that.
    for skipped in 0..32 {
        let mut wire = Wire::new(TICK_HZ);
        for (at_ns, level) in edges(WORD, Rate::Dshot600).skip(skipped) {
            wire.edge(f64::from(at_ns), level);
        }
        for start_ns in [31_250.0, 62_500.0] {
            wire.now_ns = start_ns;
            let event = wire.frame(WORD, Rate::Dshot600, 1.0).pop().flatten();
            let may_be_lost = skipped % 2 == 1 && start_ns < 60_000.0;
            assert!(event == all(Rate::Dshot600) || may_be_lost, "{skipped}");
        }
    }
}

#[test]
fn a_missed_edge_spoils_one_frame() {
    for missed in 0..32 {
        let mut wire = Wire::new(TICK_HZ);
        let played: Vec<_> = edges(WORD, Rate::Dshot600).collect();
        let mut events = Vec::new();
        for (place, &(at_ns, level)) in played.iter().enumerate() {
            if place != missed {
                events.extend(wire.edge(f64::from(at_ns), level));
            }
        }
        wire.now_ns = 50_000.0;
        let first = wire.frame(WORD, Rate::Dshot600, 1.0);
        events.extend(first.into_iter().flatten());
        // Without the last falling edge the line seems to rest high, and the next frame's
        // first edge seems to be no edge: that frame is lost as well.
        let found = usize::from(missed != 31);
        let frames: Vec<_> = events
            .iter()
            .filter(|&&event| event != Event::BadFrame)
            .collect();
        assert_eq!(frames.len(), found, "{missed}: {events:?}");
        assert!(
            events.len() > found && events.len() <= 2 + found,
            "{missed}: {events:?}"
        );
        assert!(at_the_end(
            &wire.frame(WORD, Rate::Dshot600, 1.0),
            all(Rate::Dshot600)
        ));
    }
}

fn rates() -> impl Strategy<Value = Rate> {
    prop::sample::select(&Rate::ALL[..])
}

fn timers() -> impl Strategy<Value = u32> {
    prop_oneof![
        Just(TICK_HZ),
        Just(84_000_000),
        Just(7_200_000),
        7_200_000_u32..=u32::MAX,
    ]
}

/// What an edge strays, ns: often all of it.
fn jitters() -> impl Strategy<Value = Vec<f64>> {
    let one = prop_oneof![Just(-60.0), Just(60.0), -60.0..60.0];
    prop::collection::vec(one, 32)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn frames_are_decoded_in_spite_of_jitter(
        tick_hz in timers(),
        offset: u32,
        rate in rates(),
        speed in prop_oneof![Just(0.95), Just(1.05), 0.95..1.05],
        sent in prop::collection::vec((0_u16..=2047, any::<bool>(), jitters()), 1..8),
    ) {
        let mut wire = Wire::new(tick_hz);
        wire.offset = offset;
        for (value, telemetry, jitter_ns) in sent {
            let frame = Frame { value, telemetry };
            let start_ns = wire.now_ns + 100.0;
            wire.now_ns += f64::from(rate.frame_ns() + 2 * rate.bit_ns()) / speed;
            let events: Vec<_> = edges(frame.to_bits(), rate)
                .zip(jitter_ns)
                .map(|((at_ns, level), jitter_ns)| {
                    wire.edge(start_ns + f64::from(at_ns) / speed + jitter_ns, level)
                })
                .collect();
            let wanted = Some(Event::Frame { rate, frame });
            prop_assert!(at_the_end(&events, wanted), "{events:?}");
        }
    }

    #[test]
    fn a_wrong_bit_on_the_wire_is_a_bad_frame(
        rate in rates(),
        value in 0_u16..=2047,
        telemetry: bool,
        wrong in 0_u16..16,
    ) {
        let bits = Frame { value, telemetry }.to_bits() ^ 1_u16 << wrong;
        let events = Wire::new(TICK_HZ).frame(bits, rate, 1.0);
        prop_assert!(at_the_end(&events, Some(Event::BadFrame)));
    }

    #[test]
    fn any_edges_are_taken(
        tick_hz: u32,
        forced in prop::option::of(rates()),
        edges in prop::collection::vec(
            (prop_oneof![Just(0), 0_u32..3000, any::<u32>()], any::<bool>()),
            0..200,
        ),
    ) {
        let mut decoder = Decoder::new(tick_hz);
        decoder.force(forced);
        let mut at = 0_u32;
        for (step, level) in edges {
            at = at.wrapping_add(step);
            decoder.edge(at, level);
        }
    }
}
