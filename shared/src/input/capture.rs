//! From believed edges to DShot frames.
//!
//! The last 32 edges are a frame if the line rested before them, if they lie as evenly as a frame's
//! and if the check sum fits. A frame is reported at its last edge. Edges that belong to none are
//! reported once for every 32 of them, or when the line comes to rest.

use super::dshot::{Frame, Rate, check_mask};
use super::filter::{Edge, since};
use super::line::Event;

/// Edges of a frame: two a bit.
const EDGES: u8 = 32;

/// Whole bits of a frame, from a first edge to a first edge.
const WHOLE_BITS: u32 = 15;

/// Shares of the mean bit in sixteenths.
///
/// A zero is active for 6/16 and a one for 12/16. At DShot1200, 5 % too fast, a bit lasts 794 ns,
/// and two edges that each stray by 60 ns and a tick of 84 MHz move a width by 132 ns, 2.7/16.
const SHARES: u32 = 16;
const SHORTEST: u32 = 3;
const ONE: u32 = 9;
const LONGEST: u32 = 15;
/// By how much a single bit may stray from the mean one.
const STRAY: u32 = 3;

/// Ticks that a bit must have for its pulses to be told apart: 7.2 MHz for DShot600.
const LEAST_TICKS: u32 = 12;

/// Times that are kept: a frame's and the edge before it, to the next power of two.
const KEPT: usize = 64;

/// Finds frames in the edges of one line.
#[derive(Clone, Debug)]
pub(super) struct Decoder {
    rates: [Option<Limits>; 4],
    /// The rate that is taken, and whether bidirectional; nothing for all of them.
    only: Option<(Rate, bool)>,
    /// A level at least this long is no part of a frame.
    rest_ticks: u32,
    times: [u32; KEPT],
    newest: usize,
    /// Of the times, those that count: no more than a frame and the edge before it.
    held: u8,
    /// Edges that have not been reported, as a frame or as a bad one.
    unread: u8,
}

/// What one rate's bits may take.
#[derive(Clone, Copy, Debug)]
struct Limits {
    rate: Rate,
    /// All whole bits of a frame, ticks: the mean within a twelfth.
    ///
    /// Of that, 5 % are the sender's clock, and 1 % is jitter: 132 ns at most, a fifteenth a bit.
    span_least: u32,
    span_most: u32,
    /// 1.5 bits. Within a frame no level exceeds 0.95 bits; after it, senders leave at least 2
    /// bits and what remains of the last one.
    rest_ticks: u32,
}

impl Decoder {
    /// A decoder for a timer of `tick_hz`, which takes every rate that has at least 12 ticks a bit.
    pub(super) fn new(tick_hz: u32) -> Self {
        let mut decoder = Self {
            rates: Rate::ALL.map(|rate| Limits::new(tick_hz, rate)),
            only: None,
            rest_ticks: 0,
            times: [0; KEPT],
            newest: 0,
            held: 0,
            unread: 0,
        };
        decoder.take_only(None);
        decoder
    }

    /// Takes one rate of one direction; nothing for all of them.
    pub(super) fn take_only(&mut self, only: Option<(Rate, bool)>) {
        self.only = only;
        let mut taken = self.rates.iter().flatten();
        // The slowest comes first, and with it the longest rest.
        let limits = taken.find(|limits| only.is_none_or(|(rate, _)| rate == limits.rate));
        self.rest_ticks = limits.map_or(u32::MAX, |limits| limits.rest_ticks);
    }

    /// Takes an edge of another level than the one before.
    pub(super) fn edge(&mut self, at_ticks: u32, level: bool) -> Option<Event> {
        let cut = self.settle(at_ticks);
        self.push(at_ticks);
        self.unread += 1;
        if cut.is_some() {
            return cut;
        }
        let frame = self.frame(level);
        let bad = || (self.unread == EDGES).then_some(Event::Bad);
        let event = frame.or_else(bad);
        if event.is_some() {
            self.unread = 0;
        }
        event
    }

    /// Whether a frame would end with this edge, which is not taken.
    pub(super) fn ends_with(&mut self, edge: Edge) -> bool {
        let (newest, held) = (self.newest, self.held);
        self.push(edge.at_ticks);
        let ends = self.frame(edge.level).is_some();
        (self.newest, self.held) = (newest, held);
        ends
    }

    /// Reports edges that were no frame, once the line has come to rest after them.
    pub(super) fn settle(&mut self, now_ticks: u32) -> Option<Event> {
        let cut = self.unread > 0 && since(now_ticks, self.back(0)) >= self.rest_ticks;
        if cut {
            self.unread = 0;
        }
        cut.then_some(Event::Bad)
    }

    /// An edge was missed before `at_ticks`: no frame goes over it. One may begin there, as the
    /// next one does when the last edge of a frame was missed.
    pub(super) fn spoil(&mut self, at_ticks: u32) {
        // The edge before tells for how long the line may have rested.
        self.held = self.held.min(1);
        self.push(at_ticks);
        self.unread = self.unread.max(1);
    }

    /// Forgets every edge: the line has been at rest for long.
    pub(super) fn clear(&mut self) {
        self.held = 0;
        self.unread = 0;
    }

    fn push(&mut self, at_ticks: u32) {
        self.newest = (self.newest + 1) % KEPT;
        self.times[self.newest] = at_ticks;
        self.held = (self.held + 1).min(EDGES + 1);
    }

    /// The time of the edge that came `edges` before the newest one.
    fn back(&self, edges: usize) -> u32 {
        self.times[(self.newest + KEPT - edges) % KEPT]
    }

    /// The frame that ends with the newest edge, after which the line is at `level`.
    fn frame(&self, level: bool) -> Option<Event> {
        // After a frame the line rests: high, if it is bidirectional.
        let bidirectional = level;
        let other = self.only.is_some_and(|(_, only)| only != bidirectional);
        if other || self.held < EDGES {
            return None;
        }
        let first_edge_ticks = self.back(31);
        let span = self.back(1).wrapping_sub(first_edge_ticks);
        // 1.5 bits. What was before the first of all edges is taken for a rest.
        let rested = self.held == EDGES
            || first_edge_ticks.wrapping_sub(self.back(32)) >= span / (WHOLE_BITS * 2 / 3);
        if !rested {
            return None;
        }
        let rate = self.rate(span)?;
        let frame = Frame::from_bits(self.bits(span)? ^ check_mask(bidirectional))?;
        Some(Event::Frame {
            rate,
            bidirectional,
            frame,
            first_edge_ticks,
        })
    }

    /// The rate at which the whole bits take `span`.
    fn rate(&self, span: u32) -> Option<Rate> {
        let mut taken = self.rates.iter().flatten();
        let limits = taken.find(|limits| (limits.span_least..=limits.span_most).contains(&span))?;
        self.only
            .is_none_or(|(rate, _)| rate == limits.rate)
            .then_some(limits.rate)
    }

    /// The bits of the newest 32 edges, of which the whole bits take `span`.
    fn bits(&self, span: u32) -> Option<u16> {
        // Both sides of the comparisons are times of 16 · 15 bits. A span is below 500 000 ticks.
        let scaled = |ticks: u32| ticks.saturating_mul(SHARES * WHOLE_BITS);
        let mut bits = 0;
        for bit in 0..16 {
            let start = self.back(31 - 2 * bit);
            let active = scaled(self.back(30 - 2 * bit).wrapping_sub(start));
            if !(SHORTEST * span..=LONGEST * span).contains(&active) {
                return None;
            }
            // The last bit has no next edge to end it.
            if let Some(next) = 29_usize.checked_sub(2 * bit) {
                let period = scaled(self.back(next).wrapping_sub(start));
                if period.abs_diff(SHARES * span) > STRAY * span {
                    return None;
                }
            }
            bits = bits << 1 | u16::from(active >= ONE * span);
        }
        Some(bits)
    }
}

impl Limits {
    /// Nothing when the timer is too coarse for the rate.
    fn new(tick_hz: u32, rate: Rate) -> Option<Self> {
        let ticks = |numerator: u32, denominator: u32| {
            let ticks = u64::from(tick_hz) * u64::from(numerator);
            (ticks / (u64::from(denominator) * u64::from(rate.bit_hz()))) as u32
        };
        (ticks(1, 1) >= LEAST_TICKS).then(|| Self {
            rate,
            span_least: ticks(11 * WHOLE_BITS, 12),
            span_most: ticks(13 * WHOLE_BITS, 12) + 1,
            rest_ticks: ticks(3, 2),
        })
    }
}

#[cfg(test)]
mod tests;
