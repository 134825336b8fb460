//! Replies that wait for the next poll.

use heapless::Deque;
use mavlink::dialects::ardupilotmega::{
    COMMAND_ACK_DATA, MISSION_COUNT_DATA, MavParamError, MavResult, MavSeverity, PARAM_ERROR_DATA,
    STATUSTEXT_DATA,
};
use siskin_params::{ParamId, TABLE};

use super::frame::Address;
use super::ftp;
use super::payload::id_of;
use super::refusal::Refusal;
use super::sender::Sender;

/// Replies that can wait. A poll empties the queue, so it holds the most that may arrive between
/// two: 1 ms of a serial link carries at most one frame, a datagram of 1500 bytes 33 commands.
const WAITING: usize = 40;
const CHUNK_LEN: usize = 50;
/// The longest text: a parameter's refusal with another's name and the reason.
const TEXT_MAX: usize = 200;
/// `COMMAND_ACK.progress` if unknown.
const PROGRESS_UNKNOWN: u8 = u8::MAX;

/// Message id and CRC seed of PING. The dialect marks the message as superseded, which would warn
/// at each use, but clients still send it.
pub(super) const PING: (u32, u8) = (4, 237);
/// Bytes of a PING that are returned: time and sequence.
pub(super) const PING_LEN: usize = 12;

/// Something to send once.
#[derive(Clone, Copy, Debug)]
pub(super) enum Reply {
    Ack {
        to: Address,
        command: u16,
        result: MavResult,
        /// Percent, or [`PROGRESS_UNKNOWN`].
        progress: u8,
    },
    /// A message on request; the id is known to be valid.
    Message(u32),
    /// MESSAGE_INTERVAL of this message.
    Interval(u16),
    /// Time and sequence as received; as bytes they take no more room than another reply.
    Pong {
        to: Address,
        asked: [u8; PING_LEN],
    },
    /// There are no missions of this type.
    MissionCount {
        to: Address,
        mission_type: u8,
    },
    UnknownParam {
        to: Address,
        name: [u8; 16],
        index: i16,
    },
    /// A value was rejected.
    Refused {
        to: Address,
        id: ParamId,
        refusal: Refusal,
    },
    /// A text in two pieces.
    Text(MavSeverity, [&'static str; 2]),
    Ftp {
        to: Address,
        answer: ftp::Answer,
    },
}

/// The pending replies. Parameter values are broadcast, so one pending is enough for any number of
/// requests.
#[derive(Clone, Debug)]
pub(super) struct Replies {
    queue: Deque<Reply, WAITING>,
    values: [bool; TABLE.len()],
    overrun: bool,
}

impl Replies {
    pub(super) const fn new() -> Self {
        Self {
            queue: Deque::new(),
            values: [false; TABLE.len()],
            overrun: false,
        }
    }

    /// Queues a reply. If the queue is full it is dropped, and the next poll reports that.
    ///
    /// Never inlined, nor is the ACK: a dozen places call it.
    #[inline(never)]
    pub(super) fn push(&mut self, reply: Reply) {
        if self.queue.push_back(reply).is_err() {
            self.overrun = true;
        }
    }

    #[inline(never)] // as above
    pub(super) fn ack(&mut self, to: Address, command: u16, result: MavResult) {
        let progress = if result == MavResult::MAV_RESULT_IN_PROGRESS {
            PROGRESS_UNKNOWN
        } else {
            0
        };
        self.push(Reply::Ack {
            to,
            command,
            result,
            progress,
        });
    }

    #[inline(never)] // as above
    pub(super) fn text(&mut self, severity: MavSeverity, text: &'static str) {
        self.push(Reply::Text(severity, [text, ""]));
    }

    /// Reports a command's progress, percent.
    pub(super) fn progress(&mut self, to: Address, command: u16, percent: u8) {
        self.push(Reply::Ack {
            to,
            command,
            result: MavResult::MAV_RESULT_IN_PROGRESS,
            progress: percent,
        });
    }

    pub(super) fn value(&mut self, id: ParamId) {
        self.values[id as usize] = true;
    }

    pub(super) fn next(&mut self) -> Option<Reply> {
        self.queue.pop_front()
    }

    pub(super) fn next_value(&mut self) -> Option<ParamId> {
        let index = self.values.iter().position(|due| *due)?;
        self.values[index] = false;
        ParamId::ALL.get(index).copied()
    }

    /// Returns true if replies were dropped since the last call.
    pub(super) fn take_overrun(&mut self) -> bool {
        core::mem::take(&mut self.overrun)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.queue.is_empty()
    }
}

/// Encodes replies that do not depend on the ESC's state.
#[derive(Clone, Debug)]
pub(super) struct Writer {
    pub(super) sender: Sender,
    text_id: u16,
}

impl Writer {
    pub(super) const fn new(from: Address) -> Self {
        Self {
            sender: Sender::new(from),
            text_id: 0,
        }
    }

    /// Sends COMMAND_ACK, as bytes because the dialect may not know the command.
    pub(super) fn ack(
        &mut self,
        to: Address,
        command: u16,
        (result, progress): (MavResult, u8),
        out: &mut dyn FnMut(&[u8]),
    ) {
        let [low, high] = command.to_le_bytes();
        let payload = [
            low,
            high,
            result as u8,
            progress,
            0,
            0,
            0,
            0,
            to.system,
            to.component,
        ];
        let message = id_of::<COMMAND_ACK_DATA>();
        self.sender.send_payload(message, &payload, out);
    }

    /// Sends STATUSTEXT, in chunks of 50 bytes if it is longer.
    pub(super) fn text(
        &mut self,
        severity: MavSeverity,
        pieces: &[&str],
        out: &mut dyn FnMut(&[u8]),
    ) {
        // Whole chunks, padded with zeros.
        let mut text = [0; TEXT_MAX + CHUNK_LEN];
        let mut len = 0;
        let bytes = pieces.iter().flat_map(|piece| piece.bytes());
        // Longer text is cut off.
        for (to, byte) in text.iter_mut().take(TEXT_MAX).zip(bytes) {
            *to = byte;
            len += 1;
        }
        let mut id = 0;
        let mut chunks = 1;
        if len > CHUNK_LEN {
            self.text_id = self.text_id.checked_add(1).unwrap_or(1);
            id = self.text_id;
            // A zero marks the last chunk, so it must not be full.
            chunks = len / CHUNK_LEN + 1;
        }
        let [id_low, id_high] = id.to_le_bytes();
        let parts = text.as_chunks::<CHUNK_LEN>().0.iter();
        for (chunk, part) in parts.take(chunks).enumerate() {
            let mut payload = [0; 1 + CHUNK_LEN + 3];
            payload[0] = severity as u8;
            payload[1..][..CHUNK_LEN].copy_from_slice(part);
            payload[1 + CHUNK_LEN..].copy_from_slice(&[id_low, id_high, chunk as u8]);
            let message = id_of::<STATUSTEXT_DATA>();
            self.sender.send_payload(message, &payload, out);
        }
    }

    pub(super) fn pong(&mut self, to: Address, asked: &[u8; PING_LEN], out: &mut dyn FnMut(&[u8])) {
        let mut payload = [0; PING_LEN + 2];
        payload[..PING_LEN].copy_from_slice(asked);
        payload[PING_LEN..].copy_from_slice(&[to.system, to.component]);
        self.sender.send_payload(PING, &payload, out);
    }

    pub(super) fn mission_count(
        &mut self,
        to: Address,
        mission_type: u8,
        out: &mut dyn FnMut(&[u8]),
    ) {
        let payload = [0, 0, to.system, to.component, mission_type];
        let message = id_of::<MISSION_COUNT_DATA>();
        self.sender.send_payload(message, &payload, out);
    }

    pub(super) fn param_error(
        &mut self,
        to: Address,
        (name, index): ([u8; 16], i16),
        error: MavParamError,
        out: &mut dyn FnMut(&[u8]),
    ) {
        let [index_low, index_high] = index.to_le_bytes();
        let mut payload = [0; PARAM_ERROR_DATA::ENCODED_LEN];
        payload[..4].copy_from_slice(&[index_low, index_high, to.system, to.component]);
        payload[4..20].copy_from_slice(&name);
        payload[20] = error as u8;
        let message = id_of::<PARAM_ERROR_DATA>();
        self.sender.send_payload(message, &payload, out);
    }
}
