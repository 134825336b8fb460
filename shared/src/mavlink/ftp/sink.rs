//! Receives the bytes of a file as it is written.

use siskin_params::checksum::checksum;

/// Keeps the bytes that fit, from an offset on, and measures the whole.
#[derive(Debug, Default)]
pub(super) struct Sink<'a> {
    skip: usize,
    room: &'a mut [u8],
    /// Total bytes received.
    pub(super) len: usize,
    /// Checksum so far.
    pub(super) checksum: u32,
}

impl<'a> Sink<'a> {
    /// Creates a sink that keeps the bytes from `skip` on in `room`.
    pub(super) fn new(skip: usize, room: &'a mut [u8]) -> Self {
        Self {
            skip,
            room,
            ..Self::default()
        }
    }

    /// Never inlined: every piece of every file goes through it.
    #[inline(never)]
    pub(super) fn put(&mut self, bytes: &[u8]) {
        self.checksum = checksum(self.checksum, bytes);
        for byte in bytes {
            let place = self.len.wrapping_sub(self.skip);
            if let Some(to) = self.room.get_mut(place) {
                *to = *byte;
            }
            self.len += 1;
        }
    }
}
