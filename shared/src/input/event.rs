//! Events on a line.

use super::dshot::{Frame, Rate};
use super::signal::{Pulse, Signal};

/// A finding on the wire.
///
/// In whole words, tag and all: a chip copies it in a few instructions at every edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Event {
    /// A DShot frame with a right checksum.
    Frame {
        /// Its rate.
        rate: Rate,
        /// True if the line rests high and the checksum is inverted.
        bidirectional: bool,
        /// Its contents.
        frame: Frame,
        /// Time of its first edge, in ticks of the capturing timer.
        first_edge_ticks: u32,
    },
    /// A pulse.
    Pulse {
        /// Its kind.
        kind: Pulse,
        /// Its width, ns.
        width_ns: u32,
    },
    /// Edges that were neither.
    Bad,
}

impl Event {
    /// The signal that it belongs to; nothing for a bad one.
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
