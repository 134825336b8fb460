//! What every kind of link does, and what it is handed to do it.

use std::io;
use std::time::Duration;

use super::endpoint::Endpoint;

/// One byte stream: a TCP client, a UDP peer, a serial line while someone is there. A number is
/// never used again, so a peer that comes back gets another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct LinkId(u64);

/// What happened on a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event<'a> {
    /// Bytes came in. From UDP it is one whole datagram.
    Bytes(&'a [u8]),
    /// The stream is gone, and with it what its receiver remembers.
    Ended,
}

/// Gives each stream its number.
#[derive(Clone, Debug, Default)]
pub struct Ids(u64);

impl Ids {
    /// A number that no stream has had.
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

/// One endpoint that is open.
pub(super) trait Link {
    /// Takes in what is pending, a bounded amount, and goes on with what is being sent.
    fn receive(&mut self, inbox: &mut Inbox<'_>);
    /// Sends a frame to each peer, whole or not at all. Returns to how many it was lost.
    fn send(&mut self, frame: &[u8]) -> u64;
    /// The endpoint as it came to be: with the port that the system chose.
    fn endpoint(&self) -> Endpoint;
    /// A line for a person.
    fn describe(&self) -> String;
}

/// Whether an operation has only to be tried again later.
pub(super) fn is_pending(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted)
}
