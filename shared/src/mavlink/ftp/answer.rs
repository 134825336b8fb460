//! An answer: its contents, and the message's payload.

use super::files::{Entry, View};
use super::server::Server;
use super::sink::Sink;
use crate::mavlink::identity::Address;

/// The most data that a message has room for.
pub(super) const DATA_MAX: usize = 239;
/// Network and target, the header, data.
pub(in crate::mavlink) const PAYLOAD_MAX: usize = DATA_AT + DATA_MAX;
const DATA_AT: usize = 15;

const ACK: u8 = 128;
const NAK: u8 = 129;

/// The reason why a request is refused, by the protocol's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Error {
    InvalidDataSize = 3,
    InvalidSession = 4,
    NoSessionsAvailable = 5,
    EndOfFile = 6,
    UnknownCommand = 7,
    FileProtected = 9,
    FileNotFound = 10,
}

/// The contents of an answer.
#[derive(Clone, Copy, Debug)]
pub(super) enum Content {
    /// Nothing more than that the request was obeyed.
    Done,
    Refused(Error),
    /// The length of a file, or its checksum.
    Number(u32),
    /// The entries of a folder from this one on.
    Entries(&'static Entry),
    /// Bytes of the session's file; `last` when they are the last ones of it.
    Bytes {
        len: u8,
        last: bool,
    },
}

/// The answer to one request. The bytes that it carries are made when it is sent.
#[derive(Clone, Copy, Debug)]
pub(in crate::mavlink) struct Answer {
    pub(super) sequence: u16,
    pub(super) session: u8,
    pub(super) request: u8,
    /// The opcode of the request: clients need it to match a refusal.
    pub(super) offset: u32,
    pub(super) content: Content,
}

impl Answer {
    /// Writes the message's payload, which is zero before.
    ///
    /// Never inlined: its stack is free for the sender.
    #[inline(never)]
    pub(in crate::mavlink) fn write(
        &self,
        to: Address,
        server: &mut Server,
        view: &View,
        payload: &mut [u8; PAYLOAD_MAX],
    ) {
        let (header, data) = payload.split_at_mut(DATA_AT);
        let mut complete = false;
        let done = match self.content {
            Content::Done => Ok(0),
            Content::Refused(error) => Err(error),
            Content::Number(number) => {
                Sink::new(0, data).put(&number.to_le_bytes());
                Ok(4)
            }
            Content::Entries(entry) => {
                let mut sink = Sink::new(0, data);
                entry.write_rest(view, &mut sink);
                Ok(sink.len as u8)
            }
            Content::Bytes { len, last } => {
                complete = last;
                let room = data.get_mut(..len.into()).unwrap_or_default();
                server
                    .read((to, self.session), (self.offset, room), view)
                    .map(|()| len)
            }
        };
        if let (Err(error), [reason, ..]) = (done, data) {
            *reason = error as u8;
        }
        let [sequence_low, sequence_high] = self.sequence.to_le_bytes();
        let [a, b, c, d] = self.offset.to_le_bytes();
        header.copy_from_slice(&[
            0,
            to.system,
            to.component,
            sequence_low,
            sequence_high,
            self.session,
            if done.is_ok() { ACK } else { NAK },
            done.unwrap_or(1),
            self.request,
            u8::from(complete),
            0,
            a,
            b,
            c,
            d,
        ]);
    }
}
