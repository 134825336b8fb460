//! Noise of several kinds on the wire, a million edges each: it never arms.
//!
//! The arming time is set to none, so that only the count and quality of frames protect.

use super::authority::{Authority, Command, Timing};
use super::capture::{Decoder, Event};
use super::dshot::{Frame, Rate, edges};

const TICK_HZ: u32 = 170_000_000;
const EDGES: u32 = 1_000_000;

/// A wire with nothing behind it but the decoder and the authority, and splitmix64 for chance.
struct Wire {
    decoder: Decoder,
    authority: Authority,
    ticks: u64,
    chance: u64,
    edges: u32,
    /// Frames with a right check sum.
    frames: u32,
}

impl Wire {
    fn new(seed: u64) -> Self {
        Self {
            decoder: Decoder::new(TICK_HZ),
            authority: Authority::new(Timing {
                arm_us: 0,
                loss_us: 100_000,
            }),
            ticks: 1_000,
            chance: seed,
            edges: 0,
            frames: 0,
        }
    }

    fn random(&mut self, below: u64) -> u64 {
        self.chance = self.chance.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.chance;
        mixed = (mixed ^ mixed >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        (mixed ^ mixed >> 31) % below
    }

    fn edge(&mut self, at: u64, level: bool) {
        self.edges += 1;
        if let Some(event) = self.decoder.edge(at as u32, level) {
            self.frames += u32::from(matches!(event, Event::Frame { .. }));
            self.authority
                .wire(at * 1_000_000 / u64::from(TICK_HZ), event);
            assert!(!self.authority.armed(), "armed by noise");
            assert_eq!(self.authority.command(), Command::Stop);
        }
    }

    /// A perfectly timed word, and a pause of 2 to 100 µs.
    fn word(&mut self, bits: u16, rate: Rate) {
        for (at_ns, level) in edges(bits, rate) {
            self.edge(self.ticks + u64::from(at_ns) * 17 / 100, level);
        }
        self.ticks += u64::from(rate.frame_ns() + 2 * rate.bit_ns()) * 17 / 100;
        self.ticks += self.random(16_660) + 340;
    }

    fn rate(&mut self) -> Rate {
        Rate::ALL[self.random(3) as usize]
    }
}

#[test]
fn edges_at_random_times() {
    // Up to 1, 3.5, 12 and 60 µs apart, and now and then a rest.
    for (seed, longest) in [(1, 170), (2, 600), (3, 2_000), (4, 10_000)] {
        let mut wire = Wire::new(seed);
        let mut level = true;
        while wire.edges < EDGES / 4 {
            wire.ticks += wire.random(longest) + u64::from(wire.edges.is_multiple_of(32)) * 3_000;
            // One edge in 100 is missed.
            level ^= wire.random(100) > 0;
            wire.edge(wire.ticks, level);
        }
        assert!(wire.authority.bad_frames() > 1_000, "{longest}");
        assert!(wire.frames < 10, "{longest}");
    }
}

#[test]
fn well_timed_random_words() {
    let mut wire = Wire::new(5);
    while wire.edges < EDGES {
        let bits = wire.random(1 << 16) as u16;
        let rate = wire.rate();
        wire.word(bits, rate);
    }
    let words = wire.edges / 32;
    assert_eq!(wire.frames + wire.authority.bad_frames(), words);
    // One word in sixteen has a right check sum.
    let frames = f64::from(wire.frames) / f64::from(words);
    assert!((frames - 1.0 / 16.0).abs() < 0.01, "{frames}");
}

#[test]
fn zero_frames_with_wrong_bits() {
    let zero = Frame {
        value: 0,
        telemetry: false,
    };
    let mut wire = Wire::new(6);
    while wire.edges < EDGES {
        let mut wrong = 0_u16;
        let count = wire.random(6) as u32 + 1;
        while wrong.count_ones() < count {
            wrong |= 1 << wire.random(16);
        }
        let rate = wire.rate();
        wire.word(zero.to_bits() ^ wrong, rate);
    }
    assert!(wire.authority.bad_frames() > wire.edges / 32 * 8 / 10);
}

#[test]
fn the_same_wire_is_armed_by_frames() {
    // The tests above would pass if nothing could arm.
    let mut decoder = Decoder::new(TICK_HZ);
    let mut authority = Authority::new(Timing {
        arm_us: 0,
        loss_us: 100_000,
    });
    for frame in 0..30_u32 {
        assert!(!authority.armed());
        for (at_ns, level) in edges(0, Rate::Dshot600) {
            let ticks = frame * 170_000 + at_ns * 17 / 100;
            if let Some(event) = decoder.edge(ticks, level) {
                assert!(matches!(event, Event::Frame { .. }));
                authority.wire(u64::from(frame) * 1_000, event);
            }
        }
    }
    assert!(authority.armed());
}
