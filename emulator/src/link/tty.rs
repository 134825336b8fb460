//! MAVLink over a serial line, real or not, at its rate.

use std::collections::VecDeque;
use std::io;
use std::time::Duration;

use super::Endpoint;
use super::pacer::Pacer;
use super::stream::{Event, Inbox, Link, LinkId, is_pending};

/// Bytes read per call, whatever the rate: a kernel terminal holds as many.
const READ_BYTES: usize = 4096;

/// The device under a [`Tty`]. Reading and writing never block.
pub(super) trait Port {
    /// Reads. An error other than "not now", or a length of 0, means that nobody is at the other
    /// end.
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize>;
    /// Writes as much as there is room for.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;
    /// Tries to get the other end back.
    fn revive(&mut self, now: Duration);
    /// Returns the actual endpoint.
    fn endpoint(&self) -> Endpoint;
    /// Describes it in a line for the user.
    fn describe(&self) -> String;
}

/// A serial line, paced at its rate in both directions. Like a real line it works without a
/// listener: what is sent then is lost.
pub(super) struct Tty<P> {
    port: P,
    attached: bool,
    stream: Option<LinkId>,
    inward: Pacer,
    outward: Pacer,
    pending: VecDeque<u8>,
    max_pending: usize,
}

impl<P: Port> Tty<P> {
    pub(super) fn new(port: P, baud: u32) -> Self {
        // Half a second of the line, so that an answer does not wait longer behind telemetry that
        // is too much for the line; at least two frames of the longest kind (280 bytes).
        let max_pending = (baud as usize / 20).clamp(2 * 280, 64 * 1024);
        Self {
            port,
            attached: false,
            stream: None,
            inward: Pacer::new(baud),
            outward: Pacer::new(baud),
            pending: VecDeque::new(),
            max_pending,
        }
    }

    fn read(&mut self, inbox: &mut Inbox<'_>) {
        let budget = self.inward.budget(inbox.now).min(READ_BYTES);
        if budget == 0 {
            return;
        }
        let length = match self.port.read(&mut inbox.buffer[..budget]) {
            Ok(0) => return self.lose(inbox),
            Ok(length) => length,
            Err(error) if is_pending(&error) => 0,
            Err(_) => return self.lose(inbox),
        };
        self.attached = true;
        self.inward.pass(length);
        if length < budget {
            self.inward.idle(inbox.now);
        }
        if length > 0 {
            let id = *self.stream.get_or_insert_with(|| inbox.ids.give());
            (inbox.handle)(id, Event::Bytes(&inbox.buffer[..length]));
        }
    }

    fn write(&mut self, inbox: &mut Inbox<'_>) {
        let mut budget = self.outward.budget(inbox.now);
        while budget > 0 && !self.pending.is_empty() {
            let bytes = self.pending.as_slices().0;
            let bytes = &bytes[..bytes.len().min(budget)];
            match self.port.write(bytes) {
                Ok(length) if length > 0 => {
                    self.pending.drain(..length);
                    self.outward.pass(length);
                    budget -= length;
                }
                Err(error) if !is_pending(&error) => return self.lose(inbox),
                // The reader is slow: the time it takes is not made up for.
                _ => return self.outward.idle(inbox.now),
            }
        }
        if self.pending.is_empty() {
            self.outward.idle(inbox.now);
        }
    }

    fn lose(&mut self, inbox: &mut Inbox<'_>) {
        self.attached = false;
        self.pending.clear();
        self.inward.idle(inbox.now);
        self.outward.idle(inbox.now);
        if let Some(id) = self.stream.take() {
            (inbox.handle)(id, Event::Ended);
        }
        self.port.revive(inbox.now);
    }
}

impl<P: Port> Link for Tty<P> {
    fn receive(&mut self, inbox: &mut Inbox<'_>) {
        self.read(inbox);
        self.write(inbox);
    }

    fn send(&mut self, frame: &[u8]) -> u64 {
        if !self.attached {
            return 0;
        }
        if self.pending.len() + frame.len() > self.max_pending {
            return 1;
        }
        self.pending.extend(frame);
        0
    }

    fn endpoint(&self) -> Endpoint {
        self.port.endpoint()
    }

    fn describe(&self) -> String {
        self.port.describe()
    }
}
