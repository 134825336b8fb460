//! The interface of every kind of link.

use std::io;
use std::time::Duration;

use super::endpoint::Endpoint;

/// One byte stream: a TCP client, a UDP peer, a serial line while someone is there. Ids are never
/// reused, so a returning peer gets another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct LinkId(u64);

/// What happened on a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event<'a> {
    /// Bytes were received. From UDP it is one whole datagram.
    Bytes(&'a [u8]),
    /// The stream is gone, and so is its receiver's state.
    Ended,
}

/// Assigns ids to streams.
#[derive(Clone, Debug, Default)]
pub struct Ids(u64);

impl Ids {
    /// Returns an id that no stream has had.
    pub fn give(&mut self) -> LinkId {
        self.0 += 1;
        LinkId(self.0)
    }
}

/// What the parts of [`Links::receive`](super::Links::receive) share.
pub(super) struct Inbox<'a> {
    pub(super) now: Duration,
    pub(super) ids: &'a mut Ids,
    pub(super) buffer: &'a mut [u8],
    pub(super) handle: &'a mut dyn FnMut(LinkId, Event<'_>),
}

/// An open endpoint.
pub(super) trait Link {
    /// Takes in a bounded amount of pending data, and continues sending.
    fn receive(&mut self, inbox: &mut Inbox<'_>);
    /// Sends a frame to each peer, whole or not at all. Returns how many lost it.
    fn send(&mut self, frame: &[u8]) -> u64;
    /// Returns the actual endpoint, with the port that the system chose.
    fn endpoint(&self) -> Endpoint;
    /// Describes it in a line for the user.
    fn describe(&self) -> String;
}

/// Returns true if an operation only has to be retried later.
pub(super) fn is_pending(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted)
}
