//! The reader's session, of which there is one.

use super::answer::{Answer, Content, DATA_MAX};
use super::error::Error;
use super::files::{Entry, File, Measure};
use super::sink::Sink;
use super::view::View;
use crate::mavlink::frame::Address;
use crate::mavlink::frame::{Frame, is_signed};

/// Time after which an idle session ends, µs: a client that is gone must not lock out the next one, and a live one asks
/// again within seconds.
const SESSION_US: u64 = 10_000_000;

/// Most that requests may cost between two polls. A client that waits for each answer asks once, since answers leave at
/// a poll; requests beyond the budget are dropped as if lost. A client that uses up the budget and asks for more gets
/// nothing until the poll after the next, so that others get their turn.
const COST_MOST: u8 = 5;

/// Offsets in the message; network and target come first.
const SEQUENCE: usize = 3;
const SESSION: usize = 5;
const REQUEST: usize = 6;
const SIZE: usize = 7;
const OFFSET: usize = 11;
const PATH: usize = 15;

/// Request numbers.
mod request {
    pub(super) const NONE: u8 = 0;
    pub(super) const TERMINATE_SESSION: u8 = 1;
    pub(super) const RESET_SESSIONS: u8 = 2;
    pub(super) const LIST_DIRECTORY: u8 = 3;
    pub(super) const OPEN_FILE_RO: u8 = 4;
    pub(super) const READ_FILE: u8 = 5;
    pub(super) const CREATE_FILE: u8 = 6;
    pub(super) const RENAME: u8 = 13;
    pub(super) const CALC_FILE_CRC32: u8 = 14;
    pub(super) const BURST_READ_FILE: u8 = 15;
    /// From here on it is an answer.
    pub(super) const ACK: u8 = 128;
}

/// A file being read.
#[derive(Clone, Debug)]
struct Session {
    reader: Address,
    /// True if the reader opened it by a signed frame; nobody else can have.
    signed: bool,
    /// As numbered by the reader.
    number: u8,
    file: File,
    /// As they were when it was opened.
    len: u32,
    checksum: u32,
    used_us: u64,
    burst: Option<Burst>,
}

/// The rest of the file, sent without further requests.
#[derive(Clone, Debug)]
struct Burst {
    sequence: u16,
    offset: u32,
    size: u8,
}

impl Session {
    /// Returns true if this frame is the reader's: anybody may send unsigned frames under its address.
    fn is_of(&self, frame: &Frame) -> bool {
        self.reader == frame.from && (!self.signed || is_signed(frame.raw))
    }

    /// Reads `size` bytes at an offset, or the rest of the file if that is less.
    fn read(&self, offset: u32, size: u8) -> Result<Content, Error> {
        let left = self.len.saturating_sub(offset);
        if left == 0 {
            return Err(Error::EndOfFile);
        }
        let wanted = u32::from(size);
        Ok(Content::Bytes {
            len: left.min(wanted) as u8,
            last: left <= wanted,
        })
    }
}

/// Serves files to one reader at a time.
///
/// Every request is idempotent, so a resent one gets the same answer and none has to be kept: reopening a file begins
/// the same session, and ending a session that does not exist is no error.
#[derive(Clone, Debug, Default)]
pub(in crate::mavlink) struct Server {
    session: Option<Session>,
    /// Cost of the requests since the last poll.
    cost: u8,
    /// The sender of the last of these.
    spender: Option<Address>,
    /// Who has used up the budget and asked for more, since the last poll and before it.
    greedy: Option<Address>,
    waits: Option<Address>,
}

impl Server {
    /// Renews the budget of requests, at a poll.
    pub(in crate::mavlink) fn rest(&mut self) {
        self.cost = 0;
        self.spender = None;
        self.waits = self.greedy.take();
    }

    /// Obeys a request. Returns `None` if the frame is an answer itself, or the answer comes in a burst.
    ///
    /// Never inlined: its stack is free for what else the component does.
    #[inline(never)]
    pub(in crate::mavlink) fn handle(
        &mut self,
        now_us: u64,
        frame: &Frame,
        view: &View,
    ) -> Option<Answer> {
        let request = frame.u8(REQUEST);
        if request >= request::ACK {
            return None;
        }
        if !self.affords(frame.from, cost(request)) {
            return None;
        }
        let over = |session: &mut Session| now_us.saturating_sub(session.used_us) >= SESSION_US;
        self.session.take_if(over);
        let content = match self.obey(now_us, frame, request, view) {
            Ok(content) => content?,
            Err(error) => Content::Refused(error),
        };
        Some(Answer {
            sequence: frame.u16(SEQUENCE).wrapping_add(1),
            session: frame.u8(SESSION),
            request,
            offset: frame.u32(OFFSET),
            content,
        })
    }

    /// Charges the cost of a request; returns true if the budget covers it.
    fn affords(&mut self, from: Address, cost: u8) -> bool {
        if cost == 0 {
            return true;
        }
        if self.waits == Some(from) {
            return false;
        }
        let affords = self.cost + cost <= COST_MOST;
        if affords {
            self.cost += cost;
            self.spender = Some(from);
        } else if self.spender == Some(from) {
            self.greedy = self.spender;
        }
        affords
    }

    fn obey(
        &mut self,
        now_us: u64,
        frame: &Frame,
        request: u8,
        view: &View,
    ) -> Result<Option<Content>, Error> {
        let (size, offset) = (frame.u8(SIZE), frame.u32(OFFSET));
        if usize::from(size) > DATA_MAX {
            return Err(Error::InvalidDataSize);
        }
        let path = frame.payload.get(PATH..).unwrap_or_default();
        let path = path.get(..size.into()).unwrap_or(path);
        Ok(Some(match request {
            request::NONE => Content::Done,
            request::TERMINATE_SESSION => {
                if self.session.is_some() {
                    self.session_of(frame)?;
                }
                self.session = None;
                Content::Done
            }
            request::RESET_SESSIONS => {
                self.session.take_if(|session| session.is_of(frame));
                Content::Done
            }
            request::LIST_DIRECTORY => Content::Entries(Entry::find(path, offset)?),
            request::OPEN_FILE_RO | request::CALC_FILE_CRC32 => {
                let file = File::find(path).ok_or(Error::FileNotFound)?;
                let Measure { len, checksum } = file.measure(view);
                if request == request::CALC_FILE_CRC32 {
                    return Ok(Some(Content::Number(checksum)));
                }
                let own = |session: &Session| session.is_of(frame);
                if !self.session.as_ref().is_none_or(own) {
                    return Err(Error::NoSessionsAvailable);
                }
                self.session = Some(Session {
                    reader: frame.from,
                    signed: is_signed(frame.raw),
                    number: frame.u8(SESSION),
                    file,
                    len,
                    checksum,
                    used_us: now_us,
                    burst: None,
                });
                Content::Number(len)
            }
            request::READ_FILE | request::BURST_READ_FILE => {
                let session = self.session_of(frame)?;
                session.used_us = now_us;
                if size == 0 {
                    return Err(Error::InvalidDataSize);
                }
                let content = session.read(offset, size)?;
                if request == request::BURST_READ_FILE {
                    session.burst = Some(Burst {
                        sequence: frame.u16(SEQUENCE),
                        offset,
                        size,
                    });
                    return Ok(None);
                }
                content
            }
            request::CREATE_FILE..=request::RENAME => return Err(Error::FileProtected),
            _ => return Err(Error::UnknownCommand),
        }))
    }

    /// Returns the session that this frame belongs to.
    fn session_of(&mut self, frame: &Frame) -> Result<&mut Session, Error> {
        self.session_if(|session| session.is_of(frame) && session.number == frame.u8(SESSION))
    }

    fn session_if(&mut self, own: impl Fn(&Session) -> bool) -> Result<&mut Session, Error> {
        self.session
            .as_mut()
            .filter(|session| own(session))
            .ok_or(Error::InvalidSession)
    }

    /// Returns the greatest payload of a burst's next frame, bytes; `None` if there is no burst.
    pub(in crate::mavlink) fn burst_payload_len(&self) -> Option<usize> {
        let burst = self.session.as_ref()?.burst.as_ref()?;
        Some(PATH + usize::from(burst.size))
    }

    /// Returns the next answer of a burst and its recipient.
    pub(in crate::mavlink) fn next_of_burst(&mut self, now_us: u64) -> Option<(Address, Answer)> {
        let session = self.session.as_mut()?;
        let Burst {
            sequence,
            offset,
            size,
        } = session.burst.take()?;
        let sequence = sequence.wrapping_add(1);
        session.used_us = now_us;
        let content = session.read(offset, size).ok()?;
        if let Content::Bytes { last: false, .. } = content {
            session.burst = Some(Burst {
                sequence,
                offset: offset + u32::from(size),
                size,
            });
        }
        let answer = Answer {
            sequence,
            session: session.number,
            request: request::BURST_READ_FILE,
            offset,
            content,
        };
        Some((session.reader, answer))
    }

    /// Reads the bytes of a file that an answer asks for. If the file has changed since it was opened, the read is
    /// refused and the session ends, so that a file that was read is consistent.
    pub(super) fn read(
        &mut self,
        (reader, number): (Address, u8),
        (offset, room): (u32, &mut [u8]),
        view: &View,
    ) -> Result<(), Error> {
        let session =
            self.session_if(|session| session.reader == reader && session.number == number)?;
        let end = offset as usize + room.len();
        let mut sink = Sink::new(offset as usize, room);
        session.file.write(view, &mut sink);
        if sink.checksum != session.checksum {
            room.fill(0);
            self.session = None;
            return Err(Error::InvalidSession);
        }
        if end >= sink.len {
            session.file.read(view);
        }
        Ok(())
    }
}

/// Returns the cost of a request: opening a file means producing and summing all of it, and so does each answer.
fn cost(request: u8) -> u8 {
    match request {
        request::LIST_DIRECTORY | request::OPEN_FILE_RO | request::CALC_FILE_CRC32 => COST_MOST,
        request::READ_FILE => 1,
        _ => 0,
    }
}
