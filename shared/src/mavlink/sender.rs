//! Turns payloads into frames.

use mavlink::MAV_STX_V2;

use super::check;
use super::frame::Address;
use super::frame::SIGNATURE_LEN;
use super::frame::SIGNED;
use super::payload::PAYLOAD_MAX;
use super::signing::Signing;

/// Header and check.
const OVERHEAD_LEN: usize = 12;
const HEADER_LEN: usize = 10;

/// Numbers outgoing frames. Always MAVLink 2: an ESC's messages have ids above 255.
#[derive(Clone, Debug)]
pub(super) struct Sender {
    /// The identity's address.
    from: Address,
    sequence: u8,
    pub(super) signing: Signing,
}

impl Sender {
    /// Sends as this address.
    pub(super) const fn new(from: Address) -> Self {
        Self {
            from,
            sequence: 0,
            signing: Signing::NONE,
        }
    }

    /// Sends as another address from now on.
    pub(super) fn send_as(&mut self, from: Address) {
        self.from = from;
    }

    /// Returns the length of a frame without payload.
    pub(super) fn overhead_len(&self) -> usize {
        OVERHEAD_LEN
            + if self.signing.signs() {
                SIGNATURE_LEN
            } else {
                0
            }
    }

    /// Sends a payload of at most 255 bytes as the message with this id and CRC seed.
    pub(super) fn send_payload(
        &mut self,
        (id, extra_crc): (u32, u8),
        payload: &[u8],
        out: &mut dyn FnMut(&[u8]),
    ) {
        // MAVLink 2 omits trailing zeros, except the first byte.
        let len = payload
            .iter()
            .rposition(|byte| *byte != 0)
            .map_or(1, |last| last + 1)
            .min(PAYLOAD_MAX);
        let mut frame = [0; OVERHEAD_LEN + PAYLOAD_MAX + SIGNATURE_LEN];
        let [id_0, id_1, id_2, _] = id.to_le_bytes();
        frame[..HEADER_LEN].copy_from_slice(&[
            MAV_STX_V2,
            len as u8,
            if self.signing.signs() { SIGNED } else { 0 },
            0,
            self.sequence,
            self.from.system,
            self.from.component,
            id_0,
            id_1,
            id_2,
        ]);
        for (to, byte) in frame[HEADER_LEN..HEADER_LEN + len].iter_mut().zip(payload) {
            *to = *byte;
        }
        let check = check::of(&frame[1..HEADER_LEN + len], extra_crc);
        frame[HEADER_LEN + len..OVERHEAD_LEN + len].copy_from_slice(&check.to_le_bytes());
        self.sequence = self.sequence.wrapping_add(1);
        let (unsigned, room) = frame.split_at_mut(OVERHEAD_LEN + len);
        let mut len = unsigned.len();
        if let Some(signature) = self.signing.sign(unsigned) {
            room[..SIGNATURE_LEN].copy_from_slice(&signature);
            len += SIGNATURE_LEN;
        }
        out(&frame[..len]);
    }
}
