//! A sender's mistakes, and lack of room on the wire.

use thiserror::Error;

/// Why a datagram is not played.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Rejected {
    /// It lacks even a protocol.
    #[error("an empty datagram")]
    Empty,
    /// The first byte is no protocol.
    #[error("protocol {0} is unknown")]
    Protocol(u8),
    /// The payload does not have the protocol's length.
    #[error("{length} bytes are not a datagram of protocol {protocol}")]
    Length {
        /// The first byte.
        protocol: u8,
        /// Bytes of the datagram.
        length: usize,
    },
    /// A pulse of zero width.
    #[error("a pulse of 0 ns")]
    NoPulse,
    /// The first raw level is neither 0 nor 1.
    #[error("level {0} is neither 0 nor 1")]
    Level(u8),
    /// It would hold the wire for more than 10 s.
    #[error("{0} ns are more than 10 s")]
    TooLong(u64),
    /// Too much is pending. This one counts as dropped, the others as rejected.
    #[error("more than 100 ms wait to be played")]
    Backlog,
}
