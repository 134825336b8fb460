//! The pulse decoder at its limits.

use super::*;
use proptest::prelude::*;
use std::vec::Vec;

/// A tick is a nanosecond: widths come out as they went in.
const TICK_HZ: u32 = 1_000_000_000;

/// A decoder, and a line that is low.
struct Wire {
    decoder: Decoder,
    now: u32,
    /// Of the last pulse.
    likeness: Likeness,
}

impl Wire {
    fn new() -> Self {
        Self {
            decoder: Decoder::new(TICK_HZ),
            now: 0,
            likeness: Likeness::Neither,
        }
    }

    /// A low level and a pulse, ns. The event leaves out its likeness.
    fn pulse(&mut self, low: u32, width: u32) -> Option<Event> {
        self.now = self.now.wrapping_add(low);
        assert_eq!(self.decoder.edge(self.now, true), None);
        self.now = self.now.wrapping_add(width);
        let mut event = self.decoder.edge(self.now, false);
        if let Some(Event::Pulse { likeness, near, .. }) = &mut event {
            self.likeness = core::mem::replace(likeness, Likeness::Neither);
            *near = false;
        }
        event
    }
}

fn pulse(kind: Pulse, width_ns: u32) -> Option<Event> {
    Some(Event::Pulse {
        kind,
        width_ns,
        likeness: Likeness::Neither,
        near: false,
    })
}

#[test]
fn widths_tell_the_kind() {
    for (kind, least, most) in [
        (Pulse::Servo, 800_000, 2_200_000),
        (Pulse::OneShot125, 100_000, 275_000),
        (Pulse::OneShot42, 33_600, 92_400),
        (Pulse::Multishot, 4_000, 27_500),
    ] {
        for width in [least, (least + most) / 2, most] {
            assert_eq!(Wire::new().pulse(5_000_000, width), pulse(kind, width));
        }
        for width in [least - 1, most + 1] {
            assert_eq!(Wire::new().pulse(5_000_000, width), Some(Event::Bad));
        }
    }
}

#[test]
fn one_kind_alone_is_taken() {
    for only in Pulse::ALL {
        let mut wire = Wire::new();
        wire.decoder.take_only(Some(only));
        for kind in Pulse::ALL {
            wire.decoder.clear();
            let width = kind.end_points_ns().least;
            let wanted = if kind == only {
                pulse(kind, width)
            } else {
                Some(Event::Bad)
            };
            assert_eq!(wire.pulse(5_000_000, width), wanted);
        }
    }
}

#[test]
fn pulses_need_a_low_between_them() {
    for (width, low) in [
        (2_000_000, 2_000_000 / 64),
        (250_000, 250_000 / 64),
        (42_000, 1_000),
    ] {
        let mut wire = Wire::new();
        assert!(wire.pulse(5_000_000, width).is_some());
        assert_ne!(wire.pulse(low, width), Some(Event::Bad));
        assert_eq!(wire.pulse(low - 1, width), Some(Event::Bad));
    }
}

#[test]
fn multishot_comes_at_most_at_32_khz() {
    let mut wire = Wire::new();
    assert_eq!(wire.pulse(5_000_000, 5_000), pulse(Pulse::Multishot, 5_000));
    for _ in 0..10 {
        let event = wire.pulse(31_250 - 5_000, 5_000);
        assert_eq!(event, pulse(Pulse::Multishot, 5_000));
    }
    assert_eq!(wire.pulse(28_000 - 5_001, 5_000), Some(Event::Bad));
}

#[test]
fn the_pulse_after_what_was_none_is_not_reported() {
    let mut wire = Wire::new();
    assert_eq!(wire.pulse(5_000_000, 3_000_000), Some(Event::Bad));
    assert_eq!(wire.pulse(5_000_000, 1_000_000), None);
    assert_eq!(
        wire.pulse(5_000_000, 1_000_000),
        pulse(Pulse::Servo, 1_000_000)
    );
    wire.decoder.spoil();
    assert_eq!(wire.pulse(5_000_000, 1_000_000), None);
    assert_eq!(
        wire.pulse(5_000_000, 1_000_000),
        pulse(Pulse::Servo, 1_000_000)
    );
}

#[test]
fn a_pulse_is_held_against_the_one_before() {
    use Likeness::{Both, Either, Neither};
    for kind in Pulse::ALL {
        let ends = kind.end_points_ns();
        let alike_ns = (ends.most - ends.least) / ALIKE_PART;
        let mut wire = Wire::new();
        let mut likeness = |low, width| {
            assert!(wire.pulse(low, width).is_some());
            wire.likeness
        };
        let (middle, low) = (ends.least + 8 * alike_ns, ends.most + 40_000);
        assert_eq!(likeness(low, middle), Neither, "the first");
        assert_eq!(likeness(low, middle), Both);
        // In width.
        assert_eq!(likeness(low - alike_ns, middle + alike_ns), Both);
        assert_eq!(likeness(low, middle), Both);
        assert_eq!(likeness(low - alike_ns - 1, middle + alike_ns + 1), Either);
        assert_eq!(likeness(low, middle), Either, "back is as far");
        assert_eq!(likeness(low, middle), Both);
        // In time: late by less than half, one left out, and another sender's for ever.
        let period = low + middle;
        assert_eq!(likeness(low + period / 2 - 10, middle), Both);
        assert_eq!(likeness(low, middle), Both);
        assert_eq!(likeness(low + period, middle), Either);
        assert_eq!(likeness(low, middle), Both);
        assert_eq!(likeness(low + 2 * period, middle - alike_ns - 1), Neither);
        assert_eq!(likeness(low, middle - alike_ns - 1), Both);
        for _ in 0..NEW_RATE {
            assert_eq!(likeness(low + 2 * period, middle - alike_ns - 1), Either);
        }
        // The sender has another rate now.
        assert_eq!(likeness(low + 2 * period, middle - alike_ns - 1), Both);
    }
}

#[test]
fn bits_of_dshot150_are_no_multishot_pulses() {
    let mut wire = Wire::new();
    let mut events = Vec::new();
    for _ in 0..100 {
        events.push(wire.pulse(20_000, 5_000));
        for _ in 1..16 {
            events.push(wire.pulse(1_667, 5_000));
        }
    }
    // The very first has no predecessor to disqualify it.
    let (first, others) = events.split_first().expect("pulses were played");
    assert_eq!(*first, pulse(Pulse::Multishot, 5_000));
    assert!(!others.iter().flatten().any(|event| *event != Event::Bad));
}

#[test]
fn the_end_of_a_pulse_that_was_not_seen_to_begin_is_nothing() {
    let mut decoder = Decoder::new(TICK_HZ);
    assert_eq!(decoder.edge(1_500_000, false), None);
    let mut wire = Wire::new();
    wire.pulse(5_000_000, 1_000_000);
    wire.decoder.edge(wire.now + 1_000_000, true);
    wire.decoder.clear();
    assert_eq!(wire.decoder.edge(wire.now + 2_000_000, false), None);
}

proptest! {
    #[test]
    fn widths_are_right_to_half_a_nanosecond(
        tick_hz in 10_000_000_u32..=u32::MAX,
        width in 800_000.0..2_200_000.0_f64,
        start: u32,
    ) {
        let ticks = (width * 1e-9 * f64::from(tick_hz)).ceil();
        let mut decoder = Decoder::new(tick_hz);
        decoder.edge(start, true);
        let event = decoder.edge(start.wrapping_add(ticks as u32), false);
        let Some(Event::Pulse { width_ns, .. }) = event else {
            return Err(TestCaseError::fail("no pulse"));
        };
        let true_ns = ticks * 1e9 / f64::from(tick_hz);
        // The tick duration is accurate to 2⁻²⁴ ns.
        let error_ns = (f64::from(width_ns) - true_ns).abs();
        prop_assert!(error_ns <= 0.5 + ticks / f64::from(1 << TICK_PLACES), "{error_ns}");
    }

    #[test]
    fn any_edges_are_taken(
        tick_hz: u32,
        steps in prop::collection::vec((any::<u32>(), any::<bool>()), 0..50),
    ) {
        let mut decoder = Decoder::new(tick_hz);
        let mut at = 0_u32;
        for (step, level) in steps {
            at = at.wrapping_add(step);
            decoder.edge(at, level);
        }
    }
}
