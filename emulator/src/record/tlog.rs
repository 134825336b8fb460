//! MAVLink frames as MAVProxy and Mission Planner store them, each preceded by the microseconds since 1970 in eight
//! bytes, most significant first.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::time::Duration;

use super::sink::Sink;

/// To readers the lowest bits of a time are the link number; all frames here are of link 0.
const LINK_BITS: u64 = 3;

/// Start and message id, 256, of SETUP_SIGNING in the first ten bytes of a frame: MAVLink 1 lacks it.
const STX: u8 = 0xFD;
const SETUP_SIGNING: [u8; 3] = [0x00, 0x01, 0x00];

/// A tlog file. Frames that carry a signing key are left out: logs are passed on.
pub(super) struct Tlog {
    file: BufWriter<File>,
    /// Start of the run since 1970; simulated time counts from there.
    start: Duration,
}

impl Tlog {
    pub(super) fn new(file: File, start: Duration) -> Self {
        Self {
            file: BufWriter::new(file),
            start,
        }
    }
}

impl Sink for Tlog {
    fn frame(&mut self, time_ns: u64, frame: &[u8]) -> io::Result<()> {
        if let [STX, _, _, _, _, _, _, a, b, c, ..] = *frame
            && [a, b, c] == SETUP_SIGNING
        {
            return Ok(());
        }
        let time = self.start + Duration::from_nanos(time_ns);
        let time_us = time.as_micros() as u64 & !LINK_BITS;
        self.file.write_all(&time_us.to_be_bytes())?;
        self.file.write_all(frame)
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.file.flush()
    }
}
