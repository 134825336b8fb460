//! ESC replies on a bidirectional wire: 21 bits after a frame.

use siskin_throttle::answer::extended::Extended;
use siskin_throttle::answer::{erpm, gcr};

use super::Edge;

/// Each bit is a change or none, and the line ends high.
const MOST_EDGES: usize = gcr::BITS as usize + 1;

/// The latest that a reply may begin after its frame, ns. Nominal is 30 µs; senders listen for about twice
/// as long.
const LATEST_NS: i64 = 100_000;

/// The shortest level of a reply, in bits. Each bit of a frame has a part of at most 0.47 reply bits, so no
/// frame is taken for a reply.
const SHORTEST_BITS: f64 = 0.65;

/// The fewest edges that may be a reply: its code changes at least once in three bits.
const FEWEST_EDGES: usize = 5;

/// A reply as it was on the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reply {
    /// 21 levels, the first highest; 1 is high.
    pub(crate) bits: u32,
    /// Time per bit, ns.
    pub(crate) bit_ns: f64,
    /// From the frame's nominal end to the first edge, ns.
    pub(crate) delay_ns: i64,
}

/// What a reply carries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Content {
    /// Electrical rpm; 0 at standstill.
    Erpm(u32),
    /// Extended telemetry.
    Extended(Extended),
}

impl Reply {
    /// Returns the 12 data bits, or `None` if the code or the checksum is wrong.
    pub(crate) fn data(&self) -> Option<u16> {
        gcr::decode(self.bits)
    }

    /// Returns what the data means.
    pub(crate) fn content(&self) -> Option<Content> {
        let data = self.data()?;
        let erpm = || erpm::period_us(data).map_or(0, |period_us| 60_000_000 / period_us);
        Some(Extended::from_data(data).map_or_else(|| Content::Erpm(erpm()), Content::Extended))
    }
}

/// The edges after a frame, until it is known whether they are a reply.
#[derive(Debug)]
pub(super) struct Listener {
    end_ns: i64,
    bit_ns: f64,
    edges: Vec<Edge>,
}

/// A listener's verdict on its edges.
#[derive(Debug, PartialEq)]
pub(super) enum Heard {
    /// More edges are needed.
    More,
    /// A reply: its edges have been consumed.
    Reply(Reply),
    /// No reply. The edges, if any, were something else and are still to be decoded.
    None(Vec<Edge>),
}

impl Listener {
    /// Listens after a frame that began at `begin_ns` and whose 16 bits took `frame_ns`.
    pub(super) fn new(begin_ns: i64, frame_ns: u32) -> Self {
        Self {
            end_ns: begin_ns + i64::from(frame_ns),
            bit_ns: f64::from(frame_ns) / 16.0 * 0.8,
            edges: Vec::new(),
        }
    }

    /// Returns whether edges await a verdict.
    pub(super) fn holds_edges(&self) -> bool {
        !self.edges.is_empty()
    }

    /// Keeps an edge for the verdict.
    pub(super) fn edge(&mut self, edge: Edge) {
        self.edges.push(edge);
    }

    /// Returns the verdict, given that no edge comes before `now_ns`.
    pub(super) fn verdict(&mut self, now_ns: i64) -> Heard {
        let (Some(first), Some(last)) = (self.edges.first(), self.edges.last()) else {
            let too_late = now_ns - self.end_ns > LATEST_NS;
            return if too_late {
                Heard::None(Vec::new())
            } else {
                Heard::More
            };
        };
        // Within a reply a level lasts three bits at most.
        let rested = (now_ns - last.at_ns) as f64 > 4.0 * self.bit_ns;
        let too_long = (now_ns - first.at_ns) as f64 > (f64::from(gcr::BITS) + 2.0) * self.bit_ns;
        if !rested && !too_long && self.edges.len() <= MOST_EDGES {
            return Heard::More;
        }
        match self.reply() {
            Some(reply) => Heard::Reply(reply),
            None => Heard::None(std::mem::take(&mut self.edges)),
        }
    }

    fn reply(&self) -> Option<Reply> {
        let (first, last) = (self.edges.first()?, self.edges.last()?);
        if first.level || !last.level || self.edges.len() < FEWEST_EDGES {
            return None;
        }
        let (mut bits, mut count) = (0, 0);
        for pair in self.edges.windows(2) {
            let length = (pair[1].at_ns - pair[0].at_ns) as f64 / self.bit_ns;
            if length < SHORTEST_BITS {
                return None;
            }
            for _ in 0..libm::round(length) as u32 {
                bits = bits << 1 | u32::from(pair[0].level);
                count += 1;
            }
        }
        if count > gcr::BITS {
            return None;
        }
        let rest = gcr::BITS - count;
        Some(Reply {
            bits: bits << rest | ((1 << rest) - 1),
            bit_ns: (last.at_ns - first.at_ns) as f64 / f64::from(count),
            delay_ns: first.at_ns - self.end_ns,
        })
    }
}
