//! A DShot frame's edges as the wire had them: what its bits are, and how well they are timed.

use siskin_control::input::dshot::Rate;

use super::Edge;

/// Edges of a frame.
pub(super) const EDGES: usize = 32;

/// A pulse of at least this share of its bit is a one: the decoder's limit, between 37.5 % and 75 %.
const ONE: f64 = 0.55;

/// How a frame was sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Measured {
    /// Its bits by their shares, check sum included.
    pub(crate) bits: u16,
    /// The mean time of a bit, ns.
    pub(crate) bit_ns: f64,
    /// What part of its time each bit is active, the first bit first.
    pub(crate) shares: [f64; 16],
    /// By how much each bit begins too late or early, ns.
    pub(crate) strays_ns: [f64; 16],
}

impl Measured {
    /// Measures the edges of 16 pulses of this level; nothing where they are no such pulses.
    pub(super) fn of(edges: &[Edge], active: bool) -> Option<Self> {
        if edges.len() != EDGES || edges[0].level != active {
            return None;
        }
        let begin_ns = |bit: usize| (edges[2 * bit].at_ns - edges[0].at_ns) as f64;
        let bit_ns = begin_ns(15) / 15.0;
        if bit_ns <= 0.0 {
            return None;
        }
        let mut measured = Self {
            bits: 0,
            bit_ns,
            shares: [0.0; 16],
            strays_ns: [0.0; 16],
        };
        for bit in 0..16 {
            let active_ns = (edges[2 * bit + 1].at_ns - edges[2 * bit].at_ns) as f64;
            let share = active_ns / bit_ns;
            measured.bits = measured.bits << 1 | u16::from(share >= ONE);
            measured.shares[bit] = share;
            measured.strays_ns[bit] = begin_ns(bit) - bit as f64 * bit_ns;
        }
        Some(measured)
    }
}

/// By how much the rate of bits of this length is above its nominal one, %.
pub(super) fn rate_error_pct(bit_ns: f64, rate: Rate) -> f64 {
    (1e9 / bit_ns / f64::from(rate.bit_hz()) - 1.0) * 100.0
}
