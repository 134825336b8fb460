//! From believed edges to pulses whose width is the throttle.
//!
//! A pulse has no checksum. It is told from other edges by its width, by the time since the one
//! before, and by following another such pulse.

use super::event::Event;
use super::signal::Pulse;
use crate::math::quotient;

/// The least time from a Multishot pulse to the next, ns: 32 kHz, 5 % fast and 5 % early. The bits
/// of DShot150 are as wide as its pulses, but follow each other in 7 µs.
const MULTISHOT_PERIOD_NS: u32 = 28_000;

/// The least low time between two pulses: this, ns, and no less than 1/64 of the later one.
const LOW_NS: u32 = 1_000;

/// Binary places of the time of a tick.
const TICK_PLACES: u32 = 24;

/// Finds pulses in the edges of one line.
#[derive(Clone, Debug)]
pub(super) struct Decoder {
    kinds: [Limits; 4],
    /// The kind that is taken; nothing for all of them.
    only: Option<Pulse>,
    low_ticks: u32,
    /// The time of a tick, ns · 2²⁴.
    tick: u64,
    /// The rising edge of the latest pulse; nothing before the first one.
    rise_at: Option<u32>,
    fall_at: u32,
    /// From the pulse before to the latest one, ticks.
    spacing: Option<Spacing>,
    /// True if the last pulse was one.
    sound: bool,
}

/// Widths of one kind, ticks: from 0.8 of its least to 1.1 of its greatest, for senders whose end
/// points are wider and for stick calibration.
#[derive(Clone, Copy, Debug)]
struct Limits {
    kind: Pulse,
    least: u32,
    most: u32,
    /// From one pulse to the next.
    period: u32,
}

#[derive(Clone, Copy, Debug)]
struct Spacing {
    period: u32,
    low: u32,
}

impl Decoder {
    /// A decoder for a timer of `tick_hz`, which takes every kind.
    pub(super) fn new(tick_hz: u32) -> Self {
        let nanoseconds = 1_000_000_000_u64 << TICK_PLACES;
        Self {
            kinds: Pulse::ALL.map(|kind| Limits::new(tick_hz, kind)),
            only: None,
            low_ticks: ticks(tick_hz, LOW_NS),
            tick: nanoseconds / u64::from(tick_hz.max(1)),
            rise_at: None,
            fall_at: 0,
            spacing: None,
            sound: true,
        }
    }

    /// Takes one kind; nothing for all of them.
    pub(super) fn take_only(&mut self, only: Option<Pulse>) {
        self.only = only;
    }

    /// Takes an edge. A pulse, good or bad, is reported at its end, except for a good one
    /// after a bad one.
    pub(super) fn edge(&mut self, at_ticks: u32, level: bool) -> Option<Event> {
        if level {
            self.spacing = self.rise_at.map(|rise_at| Spacing {
                period: at_ticks.wrapping_sub(rise_at),
                low: at_ticks.wrapping_sub(self.fall_at),
            });
            self.rise_at = Some(at_ticks);
            return None;
        }
        let width = at_ticks.wrapping_sub(self.rise_at?);
        self.fall_at = at_ticks;
        let kind = self.kind(width);
        let sound = core::mem::replace(&mut self.sound, kind.is_some());
        let Some(kind) = kind else {
            return Some(Event::Bad);
        };
        sound.then(|| Event::Pulse {
            kind,
            width_ns: self.nanoseconds(width),
        })
    }

    /// An edge was missed: the next pulse follows a bad one.
    pub(super) fn spoil(&mut self) {
        self.clear();
        self.sound = false;
    }

    /// Forgets every edge: the line has been at rest for long.
    pub(super) fn clear(&mut self) {
        self.rise_at = None;
        self.sound = true;
    }

    /// The kind of the latest pulse.
    fn kind(&self, width: u32) -> Option<Pulse> {
        let mut kinds = self.kinds.iter();
        let limits = kinds.find(|limits| (limits.least..=limits.most).contains(&width))?;
        let apart = self.spacing.is_none_or(|spacing| {
            spacing.period >= limits.period && spacing.low >= self.low_ticks.max(width / 64)
        });
        let taken = self.only.is_none_or(|only| only == limits.kind);
        (apart && taken).then_some(limits.kind)
    }

    fn nanoseconds(&self, ticks: u32) -> u32 {
        let half = 1 << (TICK_PLACES - 1);
        let ns = u64::from(ticks).saturating_mul(self.tick);
        (ns.saturating_add(half) >> TICK_PLACES) as u32
    }
}

impl Limits {
    fn new(tick_hz: u32, kind: Pulse) -> Self {
        let end_points = kind.end_points_ns();
        Self {
            kind,
            least: ticks(tick_hz, end_points.least / 5 * 4),
            most: ticks(tick_hz, end_points.most / 10 * 11),
            period: match kind {
                Pulse::Multishot => ticks(tick_hz, MULTISHOT_PERIOD_NS),
                _ => 0,
            },
        }
    }
}

fn ticks(tick_hz: u32, ns: u32) -> u32 {
    quotient(u64::from(tick_hz) * u64::from(ns), 1_000_000_000)
}

#[cfg(test)]
mod tests;
