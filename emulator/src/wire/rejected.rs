//! What a sender has done wrong, or the wire has no room for.

use thiserror::Error;

/// Why a datagram is not played.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Rejected {
    /// There is not even a protocol in it.
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
    /// A pulse of no width.
    #[error("a pulse of 0 ns")]
    NoPulse,
    /// The first raw level is neither 0 nor 1.
    #[error("level {0} is neither 0 nor 1")]
    Level(u8),
    /// It would hold the wire for more than 10 s.
    #[error("{0} ns are more than 10 s")]
    TooLong(u64),
    /// Too much waits already. This one counts as dropped, the others as rejected.
    #[error("more than 100 ms wait to be played")]
    Backlog,
}
