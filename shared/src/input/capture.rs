//! From timed edges to frames.
//!
//! A frame is 16 high pulses after a quiet line, and is reported at its last falling edge. A run
//! of pulses that cannot be a frame is reported once, when that is known, and then passed over
//! until the line has been quiet.

use super::dshot::{Frame, Rate};

/// Pulses of a frame.
const PULSES: u32 = 16;

/// A pulse's share of its bit in fortieths: below the first it is too short, from the second on a
/// one, above the third too long.
///
/// A zero is high for 37.5 % and a one for 75 %; some senders use 35 % and 70 %, so the middle
/// lies at 55 %. Edges that each stray by 60 ns and half a tick move a share by at most 0.17 at
/// 630 kbit/s and [`LEAST_TICKS`], which these limits leave free.
const SHORTEST: u32 = 8;
const ONE: u32 = 22;
const LONGEST: u32 = 37;

/// Ticks that a bit must have for its pulses to be told apart: 7.2 MHz for DShot600.
const LEAST_TICKS: u32 = 12;

/// What the decoder has found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A frame with a right check sum.
    Frame {
        /// How fast it was sent.
        rate: Rate,
        /// What it carries.
        frame: Frame,
    },
    /// A run of edges that was no frame.
    BadFrame,
}

/// Finds frames of every allowed rate in the edges of one line.
#[derive(Clone, Debug)]
pub struct Decoder {
    tick_hz: u32,
    limits: [Option<Limits>; 3],
    /// Bounds of [`Decoder::quiet`], ticks: 1.5 bits of the fastest and the slowest rate.
    quiet_least: u32,
    quiet_most: u32,
    /// A low at least this long ends the present run: 1.5 of its bits.
    quiet: u32,
    level: bool,
    edge_at: u32,
    rise_at: u32,
    run: Run,
}

/// What is known of the present run of pulses.
#[derive(Clone, Debug)]
enum Run {
    /// No edge has come yet.
    Fresh,
    Pulses(Pulses),
    /// A frame has been reported; a further pulse would be one too many.
    Framed,
    /// It is no frame, and that has been reported.
    Bad,
}

/// Pulses of which each may be a bit of a frame.
#[derive(Clone, Debug)]
struct Pulses {
    first_rise_at: u32,
    count: u32,
    /// The bits that have ended, the latest one lowest.
    bits: u16,
    shortest_bit: u32,
    longest_bit: u32,
}

impl Decoder {
    /// A decoder for a timer of `tick_hz`, which takes frames of every rate that has at least 12
    /// ticks a bit: 7.2 MHz for DShot600, 1.8 MHz for DShot150. The line is taken as quiet and low.
    pub fn new(tick_hz: u32) -> Self {
        let mut decoder = Self {
            tick_hz,
            limits: [None; 3],
            quiet_least: 0,
            quiet_most: 0,
            quiet: 0,
            level: false,
            edge_at: 0,
            rise_at: 0,
            run: Run::Fresh,
        };
        decoder.force(None);
        decoder
    }

    /// Takes frames of one rate only, and counts others as bad; `None` takes every rate.
    pub fn force(&mut self, rate: Option<Rate>) {
        self.limits = Rate::ALL.map(|each| {
            rate.is_none_or(|forced| forced == each)
                .then(|| Limits::new(self.tick_hz, each))
                .flatten()
        });
        // Within a frame no low exceeds 0.9 bits; after it, senders leave at least 2 bits and what
        // remains of the last one. The rate may be off by a sixteenth.
        let fastest = rate.unwrap_or(Rate::Dshot600);
        let slowest = rate.unwrap_or(Rate::Dshot150);
        self.quiet_least = ticks(self.tick_hz, fastest, 45, 32);
        self.quiet_most = ticks(self.tick_hz, slowest, 51, 32);
        self.quiet = self.quiet_most;
    }

    /// Takes one edge: when it came, in ticks that wrap, and the level from then on.
    ///
    /// A frame is reported at the falling edge that ends its 16th pulse. Should a 17th follow
    /// without a quiet line between, that is reported as bad, after the frame.
    pub fn edge(&mut self, at_ticks: u32, level: bool) -> Option<Event> {
        let since = at_ticks.wrapping_sub(self.edge_at);
        let was = core::mem::replace(&mut self.level, level);
        self.edge_at = at_ticks;
        // A high line tells nothing of the bit's time, so it counts as resting after the longest.
        let quiet = if was { self.quiet_most } else { self.quiet };
        let rested = since >= quiet || matches!(self.run, Run::Fresh);
        if level == was || (rested && !level) {
            // An edge was missed, or the line rests high: a frame starts with neither.
            return self.spoil(rested);
        }
        if level && rested {
            return self.start(at_ticks);
        }
        if level {
            self.bit_ends(at_ticks, since)
        } else {
            self.pulse_ends(since)
        }
    }

    /// The first edge of a run; the run before it is bad if it has not come to its end.
    fn start(&mut self, at_ticks: u32) -> Option<Event> {
        let unfinished = matches!(self.run, Run::Pulses(_));
        self.rise_at = at_ticks;
        self.run = Run::Pulses(Pulses {
            first_rise_at: at_ticks,
            count: 1,
            bits: 0,
            shortest_bit: u32::MAX,
            longest_bit: 0,
        });
        unfinished.then_some(Event::BadFrame)
    }

    /// A rising edge within a run, after a low of `low` ticks.
    fn bit_ends(&mut self, at_ticks: u32, low: u32) -> Option<Event> {
        let period = at_ticks.wrapping_sub(self.rise_at);
        self.rise_at = at_ticks;
        self.set_quiet(period.saturating_add(period / 2));
        let Run::Pulses(pulses) = &mut self.run else {
            return self.spoil(false);
        };
        // Neither part of the bit was a rest, so the products below stay far from their ends.
        let Some(bit) = bit_of(period - low, period) else {
            return self.spoil(false);
        };
        pulses.bits = pulses.bits << 1 | u16::from(bit);
        pulses.shortest_bit = pulses.shortest_bit.min(period);
        pulses.longest_bit = pulses.longest_bit.max(period);
        pulses.count += 1;
        None
    }

    /// A falling edge within a run, after a high of `high` ticks.
    fn pulse_ends(&mut self, high: u32) -> Option<Event> {
        let Run::Pulses(pulses) = &self.run else {
            return None;
        };
        let span = self.rise_at.wrapping_sub(pulses.first_rise_at);
        if pulses.count == 1 {
            // No bit is known yet. A zero's pulse is the shortest, three eighths of a bit.
            self.set_quiet(high.saturating_mul(4));
            return None;
        }
        if pulses.count < PULSES {
            return None;
        }
        let decoded = self.frame(pulses, span, high);
        self.set_quiet(span / (PULSES - 1) * 3 / 2);
        self.run = match decoded {
            Some(_) => Run::Framed,
            None => Run::Bad,
        };
        Some(decoded.unwrap_or(Event::BadFrame))
    }

    /// The frame of 16 pulses, of which the last was `high` and the first 15 bits took `span`.
    fn frame(&self, pulses: &Pulses, span: u32, high: u32) -> Option<Event> {
        let mut limits = self.limits.iter().flatten();
        let rate = limits.find(|limits| limits.admit(pulses, span))?.rate;
        // The last bit has no next edge to end it: the others' mean stands in.
        let last = bit_of(high * (PULSES - 1), span)?;
        let frame = Frame::from_bits(pulses.bits << 1 | u16::from(last))?;
        Some(Event::Frame { rate, frame })
    }

    /// Passes over the present run and reports it once; `new_run` says that it has just begun.
    fn spoil(&mut self, new_run: bool) -> Option<Event> {
        let report = new_run || !matches!(self.run, Run::Bad);
        self.run = Run::Bad;
        report.then_some(Event::BadFrame)
    }

    fn set_quiet(&mut self, ticks: u32) {
        self.quiet = ticks.max(self.quiet_least).min(self.quiet_most);
    }
}

/// What the bits of one rate may take, ticks: their mean within 1/16, each within 1/8, and both a
/// tick more.
///
/// Of these, 5 % are the sender's clock and the rest is jitter: 60 ns an edge are 7.2 % of a bit of
/// DShot600.
#[derive(Clone, Copy, Debug)]
struct Limits {
    rate: Rate,
    /// The first 15 bits together.
    span_least: u32,
    span_most: u32,
    bit_least: u32,
    bit_most: u32,
}

impl Limits {
    /// Nothing when the timer is too coarse for the rate.
    fn new(tick_hz: u32, rate: Rate) -> Option<Self> {
        let whole_bits = PULSES - 1;
        (ticks(tick_hz, rate, 1, 1) >= LEAST_TICKS).then(|| Self {
            rate,
            span_least: ticks(tick_hz, rate, 15 * whole_bits, 16) - 1,
            span_most: ticks(tick_hz, rate, 17 * whole_bits, 16) + 1,
            bit_least: ticks(tick_hz, rate, 7, 8) - 1,
            bit_most: ticks(tick_hz, rate, 9, 8) + 1,
        })
    }

    fn admit(&self, pulses: &Pulses, span: u32) -> bool {
        (self.span_least..=self.span_most).contains(&span)
            && pulses.shortest_bit >= self.bit_least
            && pulses.longest_bit <= self.bit_most
    }
}

/// The ticks of `numerator / denominator` bits.
fn ticks(tick_hz: u32, rate: Rate, numerator: u32, denominator: u32) -> u32 {
    (u64::from(tick_hz) * u64::from(numerator)
        / (u64::from(denominator) * u64::from(rate.bit_hz()))) as u32
}

/// The bit of a pulse by its share of the bit's time, or nothing for a share that no bit has.
fn bit_of(high: u32, period: u32) -> Option<bool> {
    let share = high * 40;
    (share >= SHORTEST * period && share <= LONGEST * period).then_some(share >= ONE * period)
}

#[cfg(test)]
mod tests;
