//! A DShot frame's edges as they were on the wire: its bits, and how well they are timed.

use siskin_throttle::dshot::Rate;

use super::Edge;

/// Edges in a frame.
pub(super) const EDGES: usize = 32;

/// A pulse of at least this share of its bit is a one: the decoder's threshold, between 37.5 % and 75 %.
const ONE: f64 = 0.55;

/// How a frame was sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Measured {
    /// Its bits by their shares, checksum included.
    pub(crate) bits: u16,
    /// The mean time of a bit, ns.
    pub(crate) bit_ns: f64,
    /// The active share of each bit, first bit first.
    pub(crate) shares: [f64; 16],
    /// How late (or, if negative, early) each bit begins, ns.
    pub(crate) strays_ns: [f64; 16],
}

impl Measured {
    /// Measures the edges of 16 pulses of this level; `None` if they are not that.
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

/// Returns by how much the bit rate at this bit time exceeds the nominal one, %.
pub(super) fn rate_error_pct(bit_ns: f64, rate: Rate) -> f64 {
    (1e9 / bit_ns / f64::from(rate.bit_hz()) - 1.0) * 100.0
}
