//! The throttle wire at the chip's pin: the flight controller's edges in, the chip's replies out.

use std::collections::VecDeque;

use siskin_emulator::wire::Wire;
use siskin_throttle::answer::{gcr, reply_bit_hz};
use siskin_throttle::dshot::Rate;
use siskin_throttle::signal::Signal;

use crate::time::{Cycles, NEVER, ns, of_ns};

/// A longer level ends a frame: two bits of the slowest DShot, ns.
const REST_NS: u64 = 13_400;

/// Delay from sending an edge to its arrival, ns: a processor stops at the end of a code block, slightly
/// after the time it was to run to, and no edge may arrive in its past.
const CABLE_NS: u64 = 2_000;

/// A reply that the chip has put on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reply {
    /// When the frame that it answers began, ns.
    pub asked_ns: u64,
    /// That frame's rate.
    pub rate: Rate,
    /// Its 21 levels, the first in bit 20.
    pub bits: u32,
    /// Time from the frame's end to its first edge, ns.
    pub after_ns: u32,
}

impl Reply {
    /// Returns the datagram to the sender: its signal's number, the levels, and the time.
    pub fn datagram(&self) -> Vec<u8> {
        let signal = Signal::Dshot {
            rate: self.rate,
            bidirectional: true,
        };
        let mut datagram = vec![signal.number()];
        datagram.extend(self.bits.to_le_bytes());
        datagram.extend(self.after_ns.to_le_bytes());
        datagram
    }
}

/// The wire.
#[derive(Debug, Default)]
pub struct Throttle {
    /// Edges still to come: when, and the level after each.
    coming: VecDeque<(Cycles, bool)>,
    /// First edge of the latest frame, ns.
    frame_ns: Option<u64>,
    /// Time from its first edge to the next in the same direction, ns: a bit.
    bit_ns: Option<u64>,
    last_ns: u64,
    edges: u32,
    /// What the chip drives: nothing, or the edges of a reply, ns.
    driven: Option<Vec<(u64, bool)>>,
}

impl Throttle {
    /// Takes everything from the wire before a time.
    pub fn take(&mut self, wire: &mut Wire, before_ns: u64) {
        while let Some((time_ns, level)) = wire.next_edge(before_ns) {
            self.coming.push_back((of_ns(time_ns + CABLE_NS), level));
        }
    }

    /// Returns when the next edge comes.
    pub fn due(&self) -> Cycles {
        self.coming.front().map_or(NEVER, |(at, _)| *at)
    }

    /// Returns the level after the next edge.
    pub fn take_edge(&mut self) -> Option<bool> {
        let (at, level) = self.coming.pop_front()?;
        if self.driven.is_none() {
            self.listen(ns(at));
        }
        Some(level)
    }

    /// Finds frames among the edges.
    fn listen(&mut self, now_ns: u64) {
        if now_ns - self.last_ns > REST_NS || self.frame_ns.is_none() {
            self.frame_ns = Some(now_ns);
            self.bit_ns = None;
            self.edges = 0;
        }
        if self.edges == 2 {
            self.bit_ns = self.frame_ns.map(|first_ns| now_ns - first_ns);
        }
        self.edges += 1;
        self.last_ns = now_ns;
    }

    /// Returns when the latest frame began, ns.
    pub fn frame_ns(&self) -> Option<u64> {
        self.frame_ns
    }

    /// Returns whether the latest edge is the last of a DShot frame: its 32nd.
    pub fn is_whole(&self) -> bool {
        self.edges == 32
    }

    /// Lets the chip drive its pin, or release it, from now on; returns a reply completed by that.
    pub fn drive(&mut self, now: Cycles, level: Option<bool>) -> Option<Reply> {
        match (level, &mut self.driven) {
            (Some(level), Some(edges)) => {
                edges.push((ns(now), level));
                None
            }
            (Some(level), None) => {
                self.driven = Some(vec![(ns(now), level)]);
                None
            }
            (None, _) => {
                let edges = self.driven.take()?;
                self.reply(&edges)
            }
        }
    }

    /// Decodes the chip's edges, if the first level is the line's rest level and a low follows.
    fn reply(&self, edges: &[(u64, bool)]) -> Option<Reply> {
        let asked_ns = self.frame_ns?;
        let rate = rate_of(self.bit_ns?)?;
        let (first_ns, _) = *edges.iter().find(|(_, level)| !level)?;
        let bit_hz = u64::from(reply_bit_hz(rate));
        let mut bits = 0;
        for bit in 0..u64::from(gcr::BITS) {
            let middle_ns = first_ns + (2 * bit + 1) * 500_000_000 / bit_hz;
            let before = edges.iter().rev().find(|(at_ns, _)| *at_ns <= middle_ns);
            bits = bits << 1 | u32::from(before.is_none_or(|(_, level)| *level));
        }
        let end_ns = asked_ns + u64::from(rate.frame_ns());
        Some(Reply {
            asked_ns,
            rate,
            bits,
            after_ns: first_ns.saturating_sub(end_ns) as u32,
        })
    }
}

/// Returns the rate with the nearest bit time, to within an eighth.
fn rate_of(bit_ns: u64) -> Option<Rate> {
    let near =
        |rate: &Rate| bit_ns.abs_diff(u64::from(rate.bit_ns())) < u64::from(rate.bit_ns()) / 8;
    Rate::ALL.into_iter().find(near)
}

#[cfg(test)]
mod tests {
    use siskin_throttle::dshot::edges;

    use super::*;

    /// A frame on a line that rests high.
    fn hear(throttle: &mut Throttle, from_ns: u64, rate: Rate) {
        for (after_ns, level) in edges(0x0426, rate) {
            let at_ns = from_ns + u64::from(after_ns);
            throttle.coming.push_back((of_ns(at_ns), !level));
            assert_eq!(throttle.take_edge(), Some(!level));
        }
    }

    #[test]
    fn a_reply_is_read_off_the_pin() {
        for rate in Rate::ALL {
            let mut throttle = Throttle::default();
            hear(&mut throttle, 1_000_000, rate);
            assert!(throttle.is_whole());
            let word = gcr::encode(0x0abc);
            let start_ns = 1_000_000 + u64::from(rate.frame_ns()) + 30_400;
            assert_eq!(throttle.drive(of_ns(start_ns - 9_000), Some(true)), None);
            for bit in 0..21 {
                let at_ns = start_ns + bit * 1_000_000_000 / u64::from(reply_bit_hz(rate));
                throttle.drive(of_ns(at_ns), Some(word >> (20 - bit) & 1 == 1));
            }
            let reply = throttle.drive(of_ns(start_ns + 300_000), None).unwrap();
            assert_eq!((reply.bits, reply.rate), (word, rate));
            assert_eq!(reply.asked_ns, 1_000_000);
            assert!(reply.after_ns.abs_diff(30_400) < 10, "{reply:?}");
        }
    }

    #[test]
    fn a_pin_that_never_falls_is_no_reply() {
        let mut throttle = Throttle::default();
        hear(&mut throttle, 0, Rate::Dshot600);
        throttle.drive(9_000, Some(true));
        assert_eq!(throttle.drive(19_000, None), None);
    }
}
