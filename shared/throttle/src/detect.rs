//! Detects the signal on a line from the decoders' events.
//!
//! DShot and pulses each have a candidate, with the evidence for and against it. The candidate that lasts is
//! the signal.

use super::event::Event;
use super::signal::Signal;

/// Hits needed to accept a signal, along with the time below. At 50 Hz four pulses take 60 ms, and the first
/// may come 20 ms late.
const HITS: u32 = 4;
const HELD_MS: u32 = 50;

/// The longest gap between two hits, ms.
const GAP_MS: u32 = 100;

/// The candidates on one line.
#[derive(Clone, Debug)]
pub(super) struct Detector {
    held_ticks: u32,
    gap_ticks: u32,
    frames: Option<Candidate>,
    pulses: Option<Candidate>,
}

#[derive(Clone, Copy, Debug)]
struct Candidate {
    signal: Signal,
    hits: u32,
    misses: u32,
    first_at: u32,
    last_at: u32,
}

impl Detector {
    pub(super) fn new(tick_hz: u32) -> Self {
        Self {
            held_ticks: tick_hz / 1000 * HELD_MS,
            gap_ticks: tick_hz / 1000 * GAP_MS,
            frames: None,
            pulses: None,
        }
    }

    /// Starts over.
    pub(super) fn clear(&mut self) {
        self.frames = None;
        self.pulses = None;
    }

    /// Returns the signal once it is known.
    pub(super) fn signal(&self) -> Option<Signal> {
        let known = |candidate: &Candidate| {
            candidate.hits >= HITS
                && candidate.misses <= candidate.hits / 2
                && candidate.last_at.wrapping_sub(candidate.first_at) >= self.held_ticks
        };
        // A correct checksum outweighs a width.
        let leading = self.frames.or(self.pulses);
        leading.filter(known).map(|candidate| candidate.signal)
    }

    /// Weighs an event of the DShot decoder, and returns it if it should be passed on.
    pub(super) fn frame(&mut self, at_ticks: u32, event: Event) -> Option<Event> {
        let Some(signal) = event.signal() else {
            self.frames = self.frames.and_then(Candidate::missed);
            // While pulses lead, these edges belong to them.
            return self.pulses.is_none().then_some(event);
        };
        let gap_ticks = self.gap_ticks;
        if let Some(frames) = self
            .frames
            .filter(|frames| frames.lasts(at_ticks, gap_ticks))
        {
            if frames.signal == signal {
                self.frames = Some(frames.hit(at_ticks));
                return Some(event);
            }
            if let Some(frames) = frames.missed() {
                self.frames = Some(frames);
                return Some(Event::Bad);
            }
        }
        self.frames = Some(Candidate::new(signal, at_ticks));
        Some(event)
    }

    /// Weighs an event of the pulse decoder, and returns it if it should be passed on.
    pub(super) fn pulse(&mut self, at_ticks: u32, event: Event) -> Option<Event> {
        let before = self.pulses.take();
        if let Event::Pulse { kind, near, .. } = event {
            let signal = Signal::Pulse(kind);
            // Pulses have no checksum, so nothing may count against them.
            let same = before.filter(|pulses| {
                pulses.signal == signal && pulses.lasts(at_ticks, self.gap_ticks) && near
            });
            let candidate = same.map_or(Candidate::new(signal, at_ticks), |pulses| {
                pulses.hit(at_ticks)
            });
            self.pulses = Some(candidate);
        } else if before.is_none() {
            return None;
        }
        // While frames lead, these edges belong to them.
        self.frames.is_none().then_some(event)
    }
}

impl Candidate {
    /// Creates a candidate with its first hit.
    fn new(signal: Signal, at_ticks: u32) -> Self {
        Self {
            signal,
            hits: 1,
            misses: 0,
            first_at: at_ticks,
            last_at: at_ticks,
        }
    }

    fn hit(self, at_ticks: u32) -> Self {
        Self {
            hits: self.hits.saturating_add(1),
            last_at: at_ticks,
            ..self
        }
    }

    /// Counts a miss; returns `None` when misses outweigh hits.
    fn missed(self) -> Option<Self> {
        let misses = self.misses.saturating_add(1);
        (misses <= self.hits).then_some(Self { misses, ..self })
    }

    fn lasts(&self, at_ticks: u32, gap_ticks: u32) -> bool {
        at_ticks.wrapping_sub(self.last_at) <= gap_ticks
    }
}
