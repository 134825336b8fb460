//! Decodes DShot frames from filtered edges.
//!
//! The last 32 edges are a frame if the line was at rest before them, if their spacing is a frame's and if the
//! checksum matches. A frame is reported at its last edge. Edges that belong to none are reported once per 32,
//! or when the line comes to rest.

use core::num::NonZeroU32;

use siskin_units::math::quotient;

use super::dshot::{Frame, Rate, check_mask};
use super::event::Event;
use super::filter::{Edge, since};

/// Edges in a frame: two per bit.
const EDGES: u8 = 32;

/// Offset from a frame's last edge back to its first.
const EDGES_BEFORE: usize = EDGES as usize - 1;

/// Full bit periods in a frame, from leading edge to leading edge.
const WHOLE_BITS: u32 = 15;

/// Thresholds below are in sixteenths of the mean bit.
///
/// A zero is active for 6/16, a one for 12/16. At DShot1200, 5 % fast, a bit lasts 794 ns, and two edges, each
/// off by 60 ns plus one tick at 84 MHz, change a width by 132 ns, or 2.7/16.
const SHARES: u32 = 16;
const SHORTEST: u32 = 3;
const ONE: u32 = 9;
const LONGEST: u32 = 15;
/// The most a single bit may deviate from the mean.
const STRAY: u32 = 3;

/// The most that a sender's clock may be off to count as nominal, as a divisor.
const NOMINAL_PART: u32 = 32;

/// The minimum ticks per bit to tell a zero from a one: 7.2 MHz for DShot600.
const LEAST_TICKS: u32 = 12;

/// Edge times to keep: a frame's and the one before it, rounded up to a power of two.
const KEPT: usize = 64;

/// Finds DShot frames in one line's edges.
#[derive(Clone, Debug)]
// Ordered by use: the most used fields are within reach of the chip's short instructions.
#[repr(C)]
pub(super) struct Decoder {
    newest: usize,
    /// Valid entries in `times`: at most a frame and the edge before it.
    held: u8,
    /// Edges since the line last rested for `rest_least`.
    run: u8,
    /// Edges not yet reported as a frame or as bad.
    unread: u8,
    /// The only rate to accept, and whether bidirectional; `None` accepts all.
    only: Option<(Rate, bool)>,
    /// A level at least this long is not part of a frame.
    rest_ticks: u32,
    /// A level shorter than this is not the rest before a frame, even the fastest: 1.125 bits.
    rest_least: u32,
    times: [u32; KEPT],
    rates: [Option<Limits>; 4],
}

/// Timing limits of one rate.
#[derive(Clone, Copy, Debug)]
struct Limits {
    rate: Rate,
    /// Total of a frame's full bit periods, ticks: 0.75 to 1.35 of nominal. Rates are a factor of two apart, and some
    /// flight controllers' bits are a ninth longer than they should be.
    span_least: u32,
    span_most: u32,
    /// 1.5 bits. Within a frame no level is as long as 1.3, even of the slowest clock; after it, senders leave at least
    /// 2 bits plus the remainder of the last one.
    rest_ticks: u32,
}

impl Decoder {
    /// Creates a decoder for a timer of `tick_hz` that accepts every rate with at least 12 ticks per bit.
    pub(super) fn new(tick_hz: u32) -> Self {
        let mut decoder = Self {
            rates: Rate::ALL.map(|rate| Limits::new(tick_hz, rate)),
            only: None,
            rest_ticks: 0,
            rest_least: 0,
            times: [0; KEPT],
            newest: 0,
            held: 0,
            run: 0,
            unread: 0,
        };
        decoder.take_only(None);
        decoder
    }

    /// Accepts only one rate and direction; `None` accepts all.
    pub(super) fn take_only(&mut self, only: Option<(Rate, bool)>) {
        self.only = only;
        let rates = self.rates.iter().flatten();
        let mut taken = rates.filter(|limits| only.is_none_or(|(rate, _)| rate == limits.rate));
        // The rates are sorted: the slowest, with the longest rest, first and the fastest last.
        let slowest = taken.next();
        let fastest = taken.next_back().or(slowest);
        self.rest_ticks = slowest.map_or(u32::MAX, |limits| limits.rest_ticks);
        self.rest_least = fastest.map_or(u32::MAX, |limits| rest(limits.span_least));
    }

    /// Takes an edge inside a frame of the accepted rate and returns true: the fast path for nearly every edge.
    pub(super) fn pass(&mut self, at_ticks: u32) -> bool {
        let run = self.run_with(at_ticks);
        let begins_or_goes_on = run > 1 || self.unread == 0;
        let passes = begins_or_goes_on && run < EDGES && self.unread < EDGES - 1;
        if passes {
            self.push_of_run(at_ticks, run);
            self.unread += 1;
        }
        passes
    }

    /// Takes an edge whose level differs from the previous one.
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

    /// Takes an edge only if it completes a frame, and returns that frame.
    pub(super) fn end(&mut self, edge: Edge) -> Option<Event> {
        // Within a frame of the accepted rate no level is as long as a rest.
        if self.only.is_some() && self.run != EDGES - 1 {
            return None;
        }
        let before = (self.newest, self.held, self.run);
        self.push(edge.at_ticks);
        let event = self.frame(edge.level);
        if event.is_some() {
            self.unread = 0;
        } else {
            (self.newest, self.held, self.run) = before;
        }
        event
    }

    /// Takes a whole frame's edges at once, the leading and trailing edge of each of its 16 bits, after a rest
    /// at this kind of wire's idle level. Returns `None`, and takes none of them, if they are not such a frame.
    /// Equivalent to taking them one by one, in a tenth of the time.
    #[inline(always)]
    pub(super) fn whole(
        &mut self,
        bidirectional: bool,
        bit: impl Fn(usize) -> (u32, u32),
    ) -> Option<Event> {
        if self.only.is_some_and(|(_, only)| only != bidirectional) {
            return None;
        }
        let (first, _) = bit(0);
        let (start, end) = bit(15);
        let span = start.wrapping_sub(first);
        let before_ticks = first.wrapping_sub(self.back(0));
        let rested = self.held == 0 || before_ticks >= rest(span).max(self.rest_least);
        if self.unread > 0 || !rested {
            return None;
        }
        let event = self.sound(first, span, bidirectional, bit)?;
        // The next frame needs the time at which this one ended.
        self.push_of_run(end, EDGES);
        self.held = 1;
        Some(event)
    }

    /// Reports edges that formed no frame, once the line has come to rest after them.
    pub(super) fn settle(&mut self, now_ticks: u32) -> Option<Event> {
        let cut = self.rests(now_ticks);
        if cut {
            self.unread = 0;
        }
        cut.then_some(Event::Bad)
    }

    /// Records that an edge was missed before `at_ticks`: no frame spans it. A frame may start there, as the
    /// next one does when a frame's last edge was missed.
    pub(super) fn spoil(&mut self, at_ticks: u32) {
        // Keep the previous edge: it shows how long the line may have rested.
        self.held = self.held.min(1);
        self.run = self.held;
        self.push(at_ticks);
        self.unread = self.unread.max(1);
    }

    /// Forgets every edge, after a long rest.
    pub(super) fn clear(&mut self) {
        self.held = 0;
        self.run = 0;
        self.unread = 0;
    }

    /// Returns true if the line has come to rest after unreported edges.
    fn rests(&self, now_ticks: u32) -> bool {
        self.unread > 0 && since(now_ticks, self.back(0)) >= self.rest_ticks
    }

    /// Returns the run length including an edge at this time.
    fn run_with(&self, at_ticks: u32) -> u8 {
        if at_ticks.wrapping_sub(self.back(0)) >= self.rest_least {
            1
        } else {
            self.run.saturating_add(1)
        }
    }

    fn push(&mut self, at_ticks: u32) {
        self.push_of_run(at_ticks, self.run_with(at_ticks));
    }

    fn push_of_run(&mut self, at_ticks: u32, run: u8) {
        self.run = run;
        self.newest = (self.newest + 1) % KEPT;
        self.times[self.newest] = at_ticks;
        if self.held <= EDGES {
            self.held += 1;
        }
    }

    /// Returns the time of the edge `edges` before the newest.
    fn back(&self, edges: usize) -> u32 {
        self.times[(self.newest + KEPT - edges) % KEPT]
    }

    /// Returns the frame that ends with the newest edge, after which the line is at `level`.
    fn frame(&self, level: bool) -> Option<Event> {
        // After a bidirectional frame the line rests high.
        let bidirectional = level;
        let other = self.only.is_some_and(|(_, only)| only != bidirectional);
        if other || self.held < EDGES {
            return None;
        }
        let first_edge_ticks = self.back(EDGES_BEFORE);
        let span = self.back(1).wrapping_sub(first_edge_ticks);
        let before_ticks = first_edge_ticks.wrapping_sub(self.back(EDGES_BEFORE + 1));
        // The time before the very first edge counts as a rest.
        let rested = self.held == EDGES || before_ticks >= rest(span);
        if !rested {
            return None;
        }
        self.sound(first_edge_ticks, span, bidirectional, |bit| {
            let start = EDGES_BEFORE - 2 * bit;
            (self.back(start), self.back(start - 1))
        })
    }

    /// Checks and decodes a frame of 16 bits whose full bit periods take `span`.
    #[inline(always)] // in time for the reply
    fn sound(
        &self,
        first_edge_ticks: u32,
        span: u32,
        bidirectional: bool,
        bit: impl Fn(usize) -> (u32, u32),
    ) -> Option<Event> {
        let limits = self.limits(span)?;
        let frame = Frame::from_bits(read(span, bit)? ^ check_mask(bidirectional))?;
        let frame_ticks = span + span / WHOLE_BITS;
        // The least span is three quarters of the nominal one, which has 15 bits of 16.
        let nominal = limits.span_least * 64 / 45;
        let off = frame_ticks.abs_diff(nominal) > nominal / NOMINAL_PART;
        Some(Event::Frame {
            rate: limits.rate,
            bidirectional,
            frame,
            first_edge_ticks,
            frame_ticks: NonZeroU32::new(frame_ticks).filter(|_| off),
        })
    }

    /// Returns the limits of the accepted rate whose full bit periods take `span`.
    fn limits(&self, span: u32) -> Option<&Limits> {
        let mut taken = self.rates.iter().flatten();
        let limits = taken.find(|limits| (limits.span_least..=limits.span_most).contains(&span))?;
        self.only
            .is_none_or(|(rate, _)| rate == limits.rate)
            .then_some(limits)
    }
}

/// Reads 16 bits from their leading and trailing edges; their full bit periods take `span`.
#[inline(always)] // in time for the reply
fn read(span: u32, bit: impl Fn(usize) -> (u32, u32)) -> Option<u16> {
    // Whole ticks, rounded towards the accepted side, of so many sixteenths of the mean bit. A span is below
    // 500 000.
    let least = |shares: u32| (shares * span).div_ceil(SHARES * WHOLE_BITS);
    let most = |shares: u32| shares * span / (SHARES * WHOLE_BITS);
    let (active_least, active_most) = (least(SHORTEST), most(LONGEST));
    let one = least(ONE);
    let (period_least, period_most) = (least(SHARES - STRAY), most(SHARES + STRAY));
    let (mut last, _) = bit(0);
    let mut bits = 0;
    for index in 0..16 {
        let (start, end) = bit(index);
        // The last bit has no following edge to end its period.
        let period = start.wrapping_sub(last);
        if index > 0 && period.wrapping_sub(period_least) > period_most - period_least {
            return None;
        }
        let active = end.wrapping_sub(start);
        if active.wrapping_sub(active_least) > active_most - active_least {
            return None;
        }
        bits = bits << 1 | u16::from(active >= one);
        last = start;
    }
    Some(bits)
}

/// Returns the minimum rest before a frame, 1.5 of its bits, whose full bit periods take `span`.
fn rest(span: u32) -> u32 {
    span / (WHOLE_BITS * 2 / 3)
}

impl Limits {
    /// Returns `None` when the timer is too coarse for the rate.
    fn new(tick_hz: u32, rate: Rate) -> Option<Self> {
        let ticks = |numerator: u32, denominator: u32| {
            let ticks = u64::from(tick_hz) * u64::from(numerator);
            quotient(ticks, denominator * rate.bit_hz())
        };
        (ticks(1, 1) >= LEAST_TICKS).then(|| Self {
            rate,
            span_least: ticks(3 * WHOLE_BITS, 4),
            span_most: ticks(27 * WHOLE_BITS, 20) + 1,
            rest_ticks: ticks(3, 2),
        })
    }
}

#[cfg(test)]
mod tests;
