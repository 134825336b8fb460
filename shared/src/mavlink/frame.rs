//! A frame and its sender.

use mavlink::MAV_STX_V2;

/// Incompatibility flag of a signed frame; any other flag is unknown here.
pub(super) const SIGNED: u8 = 0x01;

/// A frame that passed its check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Its sender.
    pub from: Address,
    /// Message id.
    pub id: u32,
    /// As received: MAVLink 2 omits trailing zeros.
    pub payload: &'a [u8],
    /// The whole frame, for its signature or a log.
    pub raw: &'a [u8],
}

impl Frame<'_> {
    /// Returns `N` bytes of the payload; omitted ones are zero.
    pub(super) fn bytes<const N: usize>(&self, offset: usize) -> [u8; N] {
        let mut bytes = [0; N];
        for (byte, sent) in bytes.iter_mut().zip(self.payload.iter().skip(offset)) {
            *byte = *sent;
        }
        bytes
    }

    /// Never inlined: every field is read through it.
    #[inline(never)]
    pub(super) fn u32(&self, offset: usize) -> u32 {
        u32::from_le_bytes(self.bytes(offset))
    }

    pub(super) fn u8(&self, offset: usize) -> u8 {
        self.u32(offset) as u8
    }

    pub(super) fn u16(&self, offset: usize) -> u16 {
        self.u32(offset) as u16
    }

    pub(super) fn i16(&self, offset: usize) -> i16 {
        self.u32(offset) as i16
    }

    pub(super) fn i32(&self, offset: usize) -> i32 {
        self.u32(offset) as i32
    }

    pub(super) fn u64(&self, offset: usize) -> u64 {
        u64::from(self.u32(offset)) | u64::from(self.u32(offset + 4)) << 32
    }

    pub(super) fn f32(&self, offset: usize) -> f32 {
        f32::from_bits(self.u32(offset))
    }

    /// Returns the target address in two bytes, system first.
    pub(super) fn address(&self, offset: usize) -> Address {
        Address {
            system: self.u8(offset),
            component: self.u8(offset + 1),
        }
    }
}

/// Returns true if a frame whose header is complete is signed.
pub(super) fn is_signed(bytes: &[u8]) -> bool {
    matches!(*bytes, [MAV_STX_V2, _, flags, ..] if flags & SIGNED != 0)
}

/// A component of a system; as a target, 0 means all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Address {
    /// System, 1 to 255.
    pub system: u8,
    /// Component within it, 1 to 255.
    pub component: u8,
}

/// Link, timestamp and hash, after a frame's checksum.
pub(super) const SIGNATURE_LEN: usize = 13;
