//! An answer: its contents and its payload.

use super::error::Error;
use super::files::Entry;

/// The most data that fits a message.
pub(super) const DATA_MAX: usize = 239;
/// Network and target, the header, data.
pub(in crate::mavlink) const PAYLOAD_MAX: usize = DATA_AT + DATA_MAX;
pub(super) const DATA_AT: usize = 15;

pub(super) const ACK: u8 = 128;
pub(super) const NAK: u8 = 129;

/// The contents of an answer.
#[derive(Clone, Copy, Debug)]
pub(super) enum Content {
    /// The request was obeyed, and nothing more.
    Done,
    Refused(Error),
    /// The length of a file, or its checksum.
    Number(u32),
    /// The entries of a folder, from this one on.
    Entries(&'static Entry),
    /// Bytes of the session's file; `last` if they are its last ones.
    Bytes {
        len: u8,
        last: bool,
    },
}

/// The answer to one request. Its bytes are produced when it is sent.
#[derive(Clone, Copy, Debug)]
pub(in crate::mavlink) struct Answer {
    pub(super) sequence: u16,
    pub(super) session: u8,
    pub(super) request: u8,
    /// The opcode of the request: clients need it to match a refusal.
    pub(super) offset: u32,
    pub(super) content: Content,
}
