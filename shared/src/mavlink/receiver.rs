//! Finds frames in bytes.

use mavlink::{MAV_STX, MAV_STX_V2};

use super::check;
use super::frame::{Address, Frame, SIGNATURE_LEN, SIGNED, is_signed};

/// The longest frame: MAVLink 2, 255 bytes of payload, signed.
const FRAME_MAX: usize = 10 + 255 + 2 + SIGNATURE_LEN;
/// Silence after which an incomplete frame is given up. A false start byte can claim 267 bytes and
/// would hold back the frames after it for as long as nobody sends more. Links that stall within a
/// frame (radios) do so for some tens of milliseconds; clients ask again after 200 ms or more.
const IDLE_US: u64 = 100_000;

/// Counts since the start, saturating.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Frames handed on.
    pub frames: u32,
    /// Frames whose check failed, including start bytes in noise.
    pub bad_checks: u32,
    /// Sound frames with an unknown incompatibility flag; they are not obeyed.
    pub incompatible: u32,
    /// Frames of a message that the dialect lacks, so that their check is unknown. What follows the
    /// start byte is searched: noise with such a number must not hide a frame.
    pub unknown: u32,
    /// Frames handed on that are signed. Whether the signature fits is not known here.
    pub signed: u32,
    /// Incomplete frames given up after silence.
    pub incomplete: u32,
}

impl Counters {
    /// Returns the number of frames not handed on.
    pub fn rejected(&self) -> u64 {
        [
            self.bad_checks,
            self.incompatible,
            self.unknown,
            self.incomplete,
        ]
        .map(u64::from)
        .iter()
        .sum()
    }
}

/// What the waiting bytes begin with.
enum Front {
    /// Nothing that could be a frame yet, or an incomplete one.
    Wait,
    /// No frame starts here.
    Reject,
    /// A sound frame of this length that is not obeyed.
    Skip(usize),
    /// A sound frame: its whole length, and the place of its payload.
    Frame {
        len: usize,
        header_len: usize,
        payload_len: usize,
    },
}

/// Finds the frames in the bytes of one link; MAVLink 1 and 2.
///
/// A candidate that fails is searched again from its second byte, so that a start byte in noise
/// costs no later frame.
#[derive(Clone, Debug)]
pub struct Receiver {
    buffer: [u8; FRAME_MAX],
    start: usize,
    end: usize,
    last_us: u64,
    counters: Counters,
}

impl Default for Receiver {
    fn default() -> Self {
        Self::new()
    }
}

impl Receiver {
    /// Creates a receiver for one link.
    pub const fn new() -> Self {
        Self {
            buffer: [0; FRAME_MAX],
            start: 0,
            end: 0,
            last_us: 0,
            counters: Counters {
                frames: 0,
                bad_checks: 0,
                incompatible: 0,
                unknown: 0,
                signed: 0,
                incomplete: 0,
            },
        }
    }

    /// Returns the counts since the start.
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// Takes bytes as they come and calls `on_frame` for each frame that they complete.
    ///
    /// Call it without bytes every few milliseconds: after 100 ms of silence an incomplete frame is
    /// given up, and what it held back is searched for frames.
    pub fn push(&mut self, now_us: u64, mut bytes: &[u8], mut on_frame: impl FnMut(&Frame)) {
        if now_us.saturating_sub(self.last_us) >= IDLE_US {
            while self.start < self.end {
                count(&mut self.counters.incomplete);
                self.start += 1;
                self.search(&mut on_frame);
            }
        }
        if !bytes.is_empty() {
            self.last_us = now_us;
        }
        while !bytes.is_empty() {
            self.compact();
            // A full buffer holds a whole frame of any length, and the search has taken it.
            let (now, later) = bytes.split_at(bytes.len().min(FRAME_MAX - self.end));
            self.buffer[self.end..self.end + now.len()].copy_from_slice(now);
            self.end += now.len();
            bytes = later;
            self.search(&mut on_frame);
        }
    }

    /// Moves the waiting bytes to the front of the buffer.
    fn compact(&mut self) {
        // Byte by byte: a general memmove takes 1.5 KB of flash.
        for (to, from) in (self.start..self.end).enumerate() {
            self.buffer[to] = self.buffer[from];
        }
        self.end -= self.start;
        self.start = 0;
    }

    /// Hands on every complete frame; what remains is incomplete or empty.
    fn search(&mut self, on_frame: &mut impl FnMut(&Frame)) {
        while self.start < self.end {
            match self.front() {
                Front::Wait => return,
                Front::Reject => self.start += 1,
                Front::Skip(len) => self.start += len,
                Front::Frame {
                    len,
                    header_len,
                    payload_len,
                } => {
                    count(&mut self.counters.frames);
                    let bytes = &self.buffer[self.start..self.start + len];
                    let (system, component, id) = sender_and_message(bytes);
                    on_frame(&Frame {
                        from: Address { system, component },
                        id,
                        payload: &bytes[header_len..header_len + payload_len],
                        raw: bytes,
                    });
                    self.start += len;
                }
            }
        }
    }

    fn front(&mut self) -> Front {
        let bytes = &self.buffer[self.start..self.end];
        let header_len = match bytes[0] {
            MAV_STX => 6,
            MAV_STX_V2 => 10,
            _ => return Front::Reject,
        };
        let version_2 = bytes[0] == MAV_STX_V2;
        if bytes.len() < header_len {
            return Front::Wait;
        }
        let (_, _, id) = sender_and_message(bytes);
        let extra_crc = check::extra_crc(id);
        // The dialect returns 0 for an unknown message; HEARTBEAT's seed is 50, and no message that
        // an ESC obeys has 0.
        if extra_crc == 0 {
            count(&mut self.counters.unknown);
            return Front::Reject;
        }
        let payload_len = usize::from(bytes[1]);
        let check_at = header_len + payload_len;
        let flags = if version_2 { bytes[2] } else { 0 };
        let signed = is_signed(bytes);
        let len = check_at + 2 + if signed { SIGNATURE_LEN } else { 0 };
        if bytes.len() < len {
            return Front::Wait;
        }
        let check = u16::from_le_bytes([bytes[check_at], bytes[check_at + 1]]);
        if check::of(&bytes[1..check_at], extra_crc) != check {
            count(&mut self.counters.bad_checks);
            return Front::Reject;
        }
        // What an unknown flag changes is unknown, but the check has found where the frame ends:
        // its payload is not searched for frames.
        if flags & !SIGNED != 0 {
            count(&mut self.counters.incompatible);
            return Front::Skip(len);
        }
        if signed {
            count(&mut self.counters.signed);
        }
        Front::Frame {
            len,
            header_len,
            payload_len,
        }
    }
}

/// Returns system, component and message of a frame whose header is complete.
fn sender_and_message(bytes: &[u8]) -> (u8, u8, u32) {
    match *bytes {
        [MAV_STX_V2, _, _, _, _, system, component, a, b, c, ..] => {
            (system, component, u32::from_le_bytes([a, b, c, 0]))
        }
        [_, _, _, system, component, id, ..] => (system, component, id.into()),
        _ => (0, 0, 0),
    }
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
