//! Events on a line.

use core::num::NonZeroU32;

use super::dshot::{Frame, Rate};
use super::signal::{Pulse, Signal};

/// What a decoder found on the wire.
///
/// Laid out in whole words, tag included: the chip copies it at every edge in a few instructions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Event {
    /// A DShot frame with a correct checksum.
    Frame {
        /// Bit rate.
        rate: Rate,
        /// The line rests high and the checksum is inverted.
        bidirectional: bool,
        /// Contents.
        frame: Frame,
        /// Time of the first edge, in ticks of the capture timer.
        first_edge_ticks: u32,
        /// Duration of its 16 bits, in the same ticks, if its sender's clock is off by more than 3 %.
        frame_ticks: Option<NonZeroU32>,
    },
    /// A pulse.
    Pulse {
        /// Kind.
        kind: Pulse,
        /// Width, ns.
        width_ns: u32,
        /// What it has in common with the pulse before it.
        likeness: Likeness,
        /// Its width is no further from that one's than a stick moves, end to end in 0.16 s at 50 Hz: an eighth of the
        /// range. Enough to tell the kind, not to trust it.
        near: bool,
    },
    /// Edges that were neither.
    Bad,
}

/// What a pulse has in common with the one before it. A sender's pulses come at an even rate, and their width changes
/// only as fast as its throttle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Likeness {
    /// Width and period.
    Both,
    /// One of them.
    Either,
    /// Nothing, or there was none before it.
    Neither,
}

impl Event {
    /// Returns the signal it belongs to; `None` for a bad one.
    pub fn signal(&self) -> Option<Signal> {
        match *self {
            Self::Frame {
                rate,
                bidirectional,
                ..
            } => Some(Signal::Dshot {
                rate,
                bidirectional,
            }),
            Self::Pulse { kind, .. } => Some(Signal::Pulse(kind)),
            Self::Bad => None,
        }
    }
}
