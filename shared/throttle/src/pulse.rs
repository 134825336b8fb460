//! Decodes pulses, whose width is the throttle, from filtered edges.
//!
//! A pulse has no checksum. Its width, the time since the previous one, and a valid pulse before it tell it
//! from other edges; those that are like it in width and in time tell a sender from noise.

use siskin_units::math::quotient;

use super::event::{Event, Likeness};
use super::signal::Pulse;

/// The minimum period of Multishot, ns: 32 kHz, 5 % fast and 5 % early. DShot150's bits are as wide as
/// Multishot's pulses, but come every 7 µs.
const MULTISHOT_PERIOD_NS: u32 = 28_000;

/// The minimum low time between two pulses, ns; at least 1/64 of the later one also applies.
const LOW_NS: u32 = 1_000;

/// The most that alike widths differ, as a divisor of the range: a stick going from end to end in 0.32 s at 50 Hz.
/// Random pulses differ by more.
const ALIKE_PART: u32 = 16;

/// The largest share of the sender's mean period by which an alike one differs, as a divisor: a sender's loop may be
/// late.
const LATE_PART: u32 = 2;

/// Pulses in a row that are alike in width and not in time, after which their period is the sender's: it has another
/// rate now. Random widths do not last as long.
const NEW_RATE: u8 = 16;

/// log2 of the number of alike periods in their mean.
const MEAN_SHIFT: u32 = 3;

/// Fraction bits of the tick duration.
const TICK_PLACES: u32 = 24;

/// Finds pulses in one line's edges.
#[derive(Clone, Debug)]
pub(super) struct Decoder {
    kinds: [Limits; 4],
    /// The only kind to accept; `None` accepts all.
    only: Option<Pulse>,
    low_ticks: u32,
    /// Duration of a tick, ns · 2²⁴.
    tick: u64,
    /// The rising edge of the latest pulse; `None` before the first.
    rise_at: Option<u32>,
    fall_at: u32,
    /// From the previous pulse to the latest.
    spacing: Option<Spacing>,
    /// The last pulse was valid.
    sound: bool,
    /// The last valid pulse; `None` before the first.
    before: Option<Before>,
}

/// Width limits of one kind, ticks: 0.8 of its minimum to 1.1 of its maximum, for senders with wider end points
/// and for stick calibration.
#[derive(Clone, Copy, Debug)]
struct Limits {
    kind: Pulse,
    least: u32,
    most: u32,
    /// The minimum period from pulse to pulse.
    period: u32,
}

#[derive(Clone, Copy, Debug)]
struct Spacing {
    period: u32,
    low: u32,
}

/// What the next pulse is held against.
#[derive(Clone, Copy, Debug)]
struct Before {
    width: u32,
    /// The mean period of its sender's pulses, `None` before the second: what comes at another rate is another's.
    mean: Option<u32>,
    /// Pulses in a row that were alike in width and not in time.
    odd: u8,
}

impl Decoder {
    /// Creates a decoder for a timer of `tick_hz` that accepts every kind.
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
            before: None,
        }
    }

    /// Accepts only one kind; `None` accepts all.
    pub(super) fn take_only(&mut self, only: Option<Pulse>) {
        self.only = only;
    }

    /// Takes an edge. A pulse, good or bad, is reported at its end, except a good one that follows a bad one.
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
        let limits = self.limits(width);
        let sound = core::mem::replace(&mut self.sound, limits.is_some());
        let Some(limits) = limits else {
            return Some(Event::Bad);
        };
        let alike = limits.alike();
        let before = self.before.map_or(0, |before| before.width);
        let near = width.abs_diff(before) <= 2 * alike;
        let likeness = self.likeness(width, alike);
        sound.then(|| Event::Pulse {
            kind: limits.kind,
            width_ns: self.nanoseconds(width),
            likeness,
            near,
        })
    }

    /// Compares the latest pulse with the one before it, and keeps it for the next.
    fn likeness(&mut self, width: u32, alike: u32) -> Likeness {
        let period = self.spacing.map(|spacing| spacing.period);
        let first = Before {
            width,
            mean: None,
            odd: 0,
        };
        let Some(before) = self.before.replace(first) else {
            return Likeness::Neither;
        };
        let mean = before.mean.or(period);
        let off = mean
            .zip(period)
            .map_or(0, |(mean, period)| period.abs_diff(mean));
        let in_time = mean.is_none_or(|mean| off <= mean / LATE_PART);
        let in_width = width.abs_diff(before.width) <= alike;
        let likeness = match (in_width, in_time) {
            (true, true) => Likeness::Both,
            (false, false) => Likeness::Neither,
            _ => Likeness::Either,
        };
        let odd = if in_width && !in_time {
            before.odd + 1
        } else {
            0
        };
        let mean = if odd < NEW_RATE { mean } else { period };
        let mean = match (mean, period) {
            (Some(mean), Some(period)) if likeness == Likeness::Both => {
                // Both are below 2³¹: a longer pause is a silence.
                Some(mean.wrapping_add_signed((period as i32 - mean as i32) >> MEAN_SHIFT))
            }
            _ => mean,
        };
        self.before = Some(Before {
            width,
            mean,
            odd: odd % NEW_RATE,
        });
        likeness
    }

    /// Records that an edge was missed: the next pulse counts as following a bad one.
    pub(super) fn spoil(&mut self) {
        self.clear();
        self.sound = false;
    }

    /// Forgets every edge, after a long rest.
    pub(super) fn clear(&mut self) {
        self.rise_at = None;
        self.sound = true;
        self.before = None;
    }

    /// Returns the limits of the latest pulse's kind.
    fn limits(&self, width: u32) -> Option<Limits> {
        let mut kinds = self.kinds.iter();
        let limits = kinds.find(|limits| (limits.least..=limits.most).contains(&width))?;
        let apart = self.spacing.is_none_or(|spacing| {
            spacing.period >= limits.period && spacing.low >= self.low_ticks.max(width / 64)
        });
        let taken = self.only.is_none_or(|only| only == limits.kind);
        (apart && taken).then_some(*limits)
    }

    fn nanoseconds(&self, ticks: u32) -> u32 {
        let half = 1 << (TICK_PLACES - 1);
        let ns = u64::from(ticks).saturating_mul(self.tick);
        (ns.saturating_add(half) >> TICK_PLACES) as u32
    }
}

impl Limits {
    /// Returns the most that alike widths differ.
    fn alike(&self) -> u32 {
        (self.most / 11 * 10 - self.least / 4 * 5) / ALIKE_PART
    }

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
