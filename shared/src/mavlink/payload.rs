//! Payloads field by field, in wire order: larger fields before smaller ones.
//!
//! The dialect's own serialisers duplicate code for each message, 1 KB of flash. Tests read what is written here with
//! the dialect's types.

use mavlink::MessageData;

/// The longest payload.
pub(super) const PAYLOAD_MAX: usize = 255;

/// Returns the id and CRC seed of a message.
pub(super) const fn id_of<D: MessageData>() -> (u32, u8) {
    (D::ID, D::EXTRA_CRC)
}

/// A payload being written; what is not written is zero.
pub(super) struct Payload {
    bytes: [u8; PAYLOAD_MAX],
    len: usize,
}

impl Payload {
    pub(super) fn new() -> Self {
        Self {
            bytes: [0; PAYLOAD_MAX],
            len: 0,
        }
    }

    /// Returns all of it: a frame omits zeros at the end.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Appends a field, least significant byte first.
    ///
    /// Never inlined, nor are longer numbers: each message calls it for each field.
    #[inline(never)]
    pub(super) fn put(&mut self, field: &[u8]) {
        let room = self.bytes.iter_mut().skip(self.len);
        for (to, byte) in room.zip(field) {
            *to = *byte;
        }
        self.len += field.len();
    }

    pub(super) fn u16(&mut self, field: u16) {
        self.put(&field.to_le_bytes());
    }

    #[inline(never)] // as above
    pub(super) fn u32(&mut self, field: u32) {
        self.put(&field.to_le_bytes());
    }

    pub(super) fn f32(&mut self, field: f32) {
        self.u32(field.to_bits());
    }

    #[inline(never)] // as above
    pub(super) fn u64(&mut self, field: u64) {
        self.put(&field.to_le_bytes());
    }
}
