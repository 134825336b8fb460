//! File transfer: no files are served, and every request is told so at once.
//!
//! Clients try files first (MAVProxy reads parameters as `@PARAM/param.pck`) and fall back only
//! after a refusal or a long silence. An answer depends on its request alone, so a request that is
//! sent again gets the same one.

use super::identity::Address;
use super::receiver::Frame;

const TERMINATE_SESSION: u8 = 1;
const OPEN_FILE_RO: u8 = 4;
const RESET_SESSIONS: u8 = 8;
const ACK: u8 = 128;
const NAK: u8 = 129;
const UNKNOWN_COMMAND: u8 = 7;
const FILE_NOT_FOUND: u8 = 10;

/// The answer to one request.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answer {
    sequence: u16,
    session: u8,
    request: u8,
    /// Why not; none when there was nothing to refuse.
    error: Option<u8>,
}

impl Answer {
    /// None when the frame is an answer itself.
    pub(super) fn to(frame: &Frame) -> Option<Self> {
        let request = frame.u8(6);
        let error = match request {
            ACK | NAK => return None,
            TERMINATE_SESSION | RESET_SESSIONS => None,
            OPEN_FILE_RO => Some(FILE_NOT_FOUND),
            _ => Some(UNKNOWN_COMMAND),
        };
        Some(Self {
            sequence: frame.u16(3).wrapping_add(1),
            session: frame.u8(5),
            request,
            error,
        })
    }

    /// The message's payload up to the first byte of data; the rest is zero.
    pub(super) fn payload(&self, to: Address) -> [u8; 16] {
        let [sequence_low, sequence_high] = self.sequence.to_le_bytes();
        let mut payload = [0; 16];
        payload[1] = to.system;
        payload[2] = to.component;
        payload[3] = sequence_low;
        payload[4] = sequence_high;
        payload[5] = self.session;
        payload[6] = if self.error.is_some() { NAK } else { ACK };
        payload[7] = u8::from(self.error.is_some());
        payload[8] = self.request;
        payload[15] = self.error.unwrap_or(0);
        payload
    }
}
