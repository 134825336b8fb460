//! A complete line: disturbances while a signal is sent, and what is decoded.

use super::*;
use crate::dshot::{check_mask, edges};
use proptest::prelude::*;
use std::vec::Vec;

mod at_once;

const TICK_HZ: u32 = 170_000_000;
const MS: u64 = 1_000_000;

/// Edges in ns since the start, and a line polled 24 000 times a second.
struct Wire {
    line: Line,
    now_ns: u64,
    settled_ns: u64,
    events: Vec<Event>,
}

impl Wire {
    fn new() -> Self {
        Self {
            line: Line::new(TICK_HZ),
            now_ns: 0,
            settled_ns: 0,
            events: Vec::new(),
        }
    }

    /// Creates a wire on which this signal has been detected.
    fn of(signal: Signal) -> Self {
        let mut wire = Self::new();
        wire.edge(0, signal.rests_high());
        wire.wait(MS);
        wire.detect(signal);
        wire
    }

    fn detect(&mut self, signal: Signal) {
        for _ in 0..20 {
            self.send(signal);
            self.wait(5 * MS);
        }
        assert_eq!(self.line.signal(), Some(signal));
        self.events.clear();
    }

    fn edge(&mut self, at_ns: u64, level: bool) {
        self.settle_until(at_ns);
        let event = self.line.edge(ticks(at_ns), level);
        self.events.extend(event);
    }

    fn settle_until(&mut self, ns: u64) {
        while self.settled_ns + 41_667 <= ns {
            self.settled_ns += 41_667;
            self.events.extend(self.line.settle(ticks(self.settled_ns)));
        }
    }

    fn wait(&mut self, ns: u64) {
        self.now_ns += ns;
        self.settle_until(self.now_ns);
    }

    /// Returns the edges, from now on, of a frame of zero throttle or of a pulse at 1/8 of the range.
    fn edges(&self, signal: Signal) -> Vec<(u64, bool)> {
        match signal {
            Signal::Dshot {
                rate,
                bidirectional,
            } => edges(check_mask(bidirectional), rate)
                .map(|(at_ns, active)| (self.now_ns + u64::from(at_ns), active != bidirectional))
                .collect(),
            Signal::Pulse(kind) => {
                let width_ns = u64::from(width_ns(kind));
                [(self.now_ns, true), (self.now_ns + width_ns, false)].into()
            }
        }
    }

    fn play(&mut self, edges: &[(u64, bool)]) {
        for &(at_ns, level) in edges {
            self.edge(at_ns, level);
        }
        self.now_ns = edges.last().map_or(self.now_ns, |(at_ns, _)| *at_ns);
    }

    fn send(&mut self, signal: Signal) {
        self.play(&self.edges(signal));
    }

    /// Sends one, waits a millisecond, and returns the events.
    fn found(&mut self, signal: Signal) -> Vec<Event> {
        self.events.clear();
        self.send(signal);
        self.wait(MS);
        core::mem::take(&mut self.events)
    }
}

fn ticks(ns: u64) -> u32 {
    (ns * 17 / 100) as u32
}

fn width_ns(kind: Pulse) -> u32 {
    let end_points = kind.end_points_ns();
    end_points.least + (end_points.most - end_points.least) / 8
}

/// Returns true for exactly one event: a frame or pulse of this signal, as sent.
fn whole(events: &[Event], signal: Signal) -> bool {
    let [event] = events else { return false };
    let right = match *event {
        Event::Frame { frame, .. } => frame.value == 0 && !frame.telemetry,
        Event::Pulse {
            kind, width_ns: ns, ..
        } => ns.abs_diff(width_ns(kind)) <= 6,
        Event::Bad => false,
    };
    right && event.signal() == Some(signal)
}

fn dshot(rate: Rate) -> Signal {
    Signal::Dshot {
        rate,
        bidirectional: false,
    }
}

fn all_dshot() -> impl Iterator<Item = Signal> {
    Signal::all().filter(|signal| matches!(signal, Signal::Dshot { .. }))
}

#[test]
fn a_frame_comes_with_its_last_edge_and_a_pulse_after_the_filter_s_time() {
    for signal in Signal::all() {
        let mut wire = Wire::of(signal);
        wire.send(signal);
        let filter_ns = u64::from(wire.line.filter.time_ticks) * 100 / 17 + 6;
        let end_ns = wire.now_ns + filter_ns;
        let at_once = matches!(signal, Signal::Dshot { .. });
        assert_eq!(wire.events.len(), usize::from(at_once));
        wire.events.extend(wire.line.settle(ticks(end_ns)));
        assert!(whole(&wire.events, signal), "{}", signal.name());
    }
}

#[test]
fn a_known_signal_is_the_only_one() {
    for known in Signal::all() {
        for other in Signal::all().filter(|other| *other != known) {
            let mut wire = Wire::of(known);
            wire.edge(wire.now_ns, other.rests_high());
            // Longer than any pulse, or it would count as one.
            wire.wait(5 * MS);
            wire.events.clear();
            for _ in 0..30 {
                let found = wire.found(other);
                let valid = found.iter().any(|event| *event != Event::Bad);
                assert!(!valid, "{} on {}", other.name(), known.name());
                assert_eq!(wire.line.signal(), Some(known));
            }
            // Once lost, the other one is detected.
            wire.line.lost();
            assert_eq!(wire.line.signal(), None);
            wire.detect(other);
        }
    }
}

#[test]
fn a_forced_signal_stays() {
    for forced in Signal::all() {
        let mut wire = Wire::new();
        wire.line.force(Some(forced));
        wire.edge(0, forced.rests_high());
        wire.wait(MS);
        assert!(whole(&wire.found(forced), forced), "from the first on");
        wire.wait(150 * MS);
        wire.line.lost();
        assert_eq!(wire.line.signal(), Some(forced));
        assert!(whole(&wire.found(forced), forced));
        wire.line.force(None);
        assert_eq!(wire.line.signal(), None);
        wire.detect(forced);
    }
}

#[test]
fn losing_what_is_not_known_yet_changes_nothing() {
    let signal = dshot(Rate::Dshot600);
    let mut wire = Wire::new();
    for _ in 0..60 {
        if wire.line.signal().is_none() {
            wire.line.lost();
        }
        wire.send(signal);
        wire.wait(MS);
    }
    assert_eq!(wire.line.signal(), Some(signal));
}

#[test]
fn glitches_within_the_filter_are_dropped() {
    for signal in Signal::all() {
        let mut wire = Wire::of(signal);
        let most_ticks = wire.line.filter.time_ticks - 1;
        let glitch_ns = u64::from(most_ticks) * 100 / 17;
        for place in 0..wire.edges(signal).len() {
            let mut played = wire.edges(signal);
            let (at_ns, level) = played[place];
            let rest_ns = wire.now_ns - 10_000;
            // One glitch in the rest before, and one in a level of the frame.
            let start_ns = at_ns + 60;
            let glitches = [
                (start_ns, !level),
                (start_ns + glitch_ns, level),
                (rest_ns, !signal.rests_high()),
                (rest_ns + glitch_ns, signal.rests_high()),
            ];
            played.extend(glitches);
            played.sort_unstable();
            wire.now_ns -= 20_000;
            wire.events.clear();
            wire.play(&played);
            wire.wait(MS);
            let [event] = wire.events[..] else {
                panic!("{}, {place}: {:?}", signal.name(), wire.events);
            };
            assert_eq!(event.signal(), Some(signal));
        }
    }
}

#[test]
fn a_line_that_is_stuck_for_longer_than_the_ticks_take_to_wrap() {
    const WRAP_NS: u64 = (1 << 32) * 100 / 17;
    for signal in Signal::all() {
        for stuck_ns in [1_000 * MS, WRAP_NS + 600] {
            for cut in [0, 1, 2, 17, 30, 31] {
                let mut wire = Wire::of(signal);
                if cut >= wire_edges(signal) {
                    continue;
                }
                // Cut after any edge, high or low, with the rest sent after the ticks have wrapped as if
                // nothing had happened in between.
                let played = wire.edges(signal);
                let (before, after) = played.split_at(cut);
                wire.play(before);
                wire.wait(stuck_ns);
                let after: Vec<_> = after
                    .iter()
                    .map(|&(at_ns, level)| (at_ns + stuck_ns, level))
                    .collect();
                wire.play(&after);
                wire.wait(MS);
                let valid = wire.events.iter().filter(|event| **event != Event::Bad);
                let uncut = usize::from(cut == 0);
                assert_eq!(valid.count(), uncut, "{}, {cut}, {stuck_ns}", signal.name());
                wire.wait(200 * MS);
                assert!(whole(&wire.found(signal), signal), "{cut}");
            }
        }
    }
}

fn wire_edges(signal: Signal) -> usize {
    match signal {
        Signal::Dshot { .. } => 32,
        Signal::Pulse(_) => 2,
    }
}

#[test]
fn a_frame_that_is_cut_is_bad_and_the_next_is_whole() {
    for signal in all_dshot() {
        for cut in (2..32).step_by(2) {
            let mut wire = Wire::of(signal);
            let played = wire.edges(signal);
            wire.play(&played[..cut]);
            wire.wait(MS);
            assert_eq!(wire.events, [Event::Bad], "{}, {cut}", signal.name());
            assert!(
                whole(&wire.found(signal), signal),
                "{}, {cut}",
                signal.name()
            );
        }
    }
}

#[test]
fn a_missed_edge_costs_one_frame_and_a_pulse_more() {
    for signal in Signal::all() {
        for missed in 0..wire_edges(signal) {
            let mut wire = Wire::of(signal);
            let mut played = wire.edges(signal);
            played.remove(missed);
            wire.play(&played);
            wire.wait(MS);
            let valid = wire.events.iter().any(|event| *event != Event::Bad);
            assert!(!valid, "{}, {missed}", signal.name());
            let spoilt = match signal {
                Signal::Dshot { .. } => 0,
                // The pulse that follows a bad one, and one that seems to have started in another.
                Signal::Pulse(_) => 1 + missed,
            };
            for _ in 0..spoilt {
                let found = wire.found(signal);
                assert!(found.iter().all(|event| *event == Event::Bad));
            }
            assert!(
                whole(&wire.found(signal), signal),
                "{}, {missed}",
                signal.name()
            );
        }
    }
}

#[test]
fn the_frame_rate_may_change_at_any_time() {
    for signal in all_dshot() {
        let mut wire = Wire::of(signal);
        let Signal::Dshot { rate, .. } = signal else {
            continue;
        };
        // From two bits of rest to 90 ms, and back.
        let shortest_ns = u64::from(rate.bit_ns() * 3);
        for rest_ns in [shortest_ns, 20_000, MS, 90 * MS, shortest_ns, 5 * MS] {
            for _ in 0..10 {
                wire.send(signal);
                wire.wait(rest_ns);
            }
            wire.wait(MS);
            let each_whole = wire.events.iter().all(|event| whole(&[*event], signal));
            assert!(each_whole, "{}, {rest_ns}", signal.name());
            assert_eq!(wire.events.len(), 10);
            wire.events.clear();
        }
        assert_eq!(wire.line.signal(), Some(signal));
    }
}

#[test]
fn frames_back_to_back_are_detected() {
    for signal in all_dshot() {
        let Signal::Dshot { rate, .. } = signal else {
            continue;
        };
        let mut wire = Wire::new();
        wire.edge(0, signal.rests_high());
        // Longer than any pulse, or it would count as one.
        wire.wait(5 * MS);
        wire.events.clear();
        while wire.now_ns < 65 * MS {
            wire.now_ns += u64::from(rate.bit_ns() * 3);
            wire.send(signal);
        }
        assert_eq!(wire.line.signal(), Some(signal));
        assert!(!wire.events.contains(&Event::Bad), "{}", signal.name());
    }
}

#[test]
fn pulses_that_jump_are_not_believed() {
    let mut wire = Wire::new();
    for pulse in 0..200 {
        wire.edge(wire.now_ns, true);
        wire.wait(if pulse % 2 == 0 { 1_000_000 } else { 1_200_000 });
        wire.edge(wire.now_ns, false);
        wire.wait(4 * MS);
        assert_eq!(wire.line.signal(), None);
    }
    wire.detect(Signal::Pulse(Pulse::Servo));
}

#[test]
fn rare_hits_are_not_believed() {
    for signal in Signal::all() {
        let mut wire = Wire::new();
        wire.edge(0, signal.rests_high());
        for _ in 0..20 {
            wire.wait(110 * MS);
            wire.send(signal);
            assert_eq!(wire.line.signal(), None, "{}", signal.name());
        }
    }
}

proptest! {
    #[test]
    fn any_edges_are_taken(
        tick_hz: u32,
        forced in 0_u8..24,
        steps in prop::collection::vec((any::<u32>(), 0_u8..33, 0_u8..20), 0..100),
    ) {
        let mut line = Line::new(tick_hz);
        line.force(Signal::from_number(forced));
        let mut now = 0_u32;
        for (step, shift, kind) in steps {
            now = now.wrapping_add(step.checked_shr(shift.into()).unwrap_or(0));
            match kind {
                0 => line.lost(),
                1..4 => {
                    line.settle(now);
                }
                _ => {
                    line.edge(now, kind % 2 == 0);
                }
            }
        }
    }
}
