//! The messages that say where a component's metadata is.

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::COMPONENT_METADATA_DATA;
use siskin_params::parts::Part;
use siskin_units::math::quotient;

use super::files::GENERAL_CHECKSUM;
use super::sink::Sink;

/// COMPONENT_INFORMATION, superseded by COMPONENT_METADATA; older ground stations ask for it.
const COMPONENT_INFORMATION_ID: u32 = 395;

/// Without a component it means the sender itself.
const GENERAL_URI: &str = "mftp:///general.json.xz";
/// The URI and the fields before it in the longer message; only zeros follow.
const PAYLOAD_LEN: usize = 12 + GENERAL_URI.len();

/// Returns true if [`metadata`] makes the message with this id, and this program has metadata.
pub(in crate::mavlink) const fn is_metadata(id: u32) -> bool {
    Part::Metadata.is_here() && matches!(id, COMPONENT_METADATA_DATA::ID | COMPONENT_INFORMATION_ID)
}

/// Returns the payload of one of these messages.
pub(in crate::mavlink) fn metadata(id: u32, now_us: u64) -> [u8; PAYLOAD_LEN] {
    let mut payload = [0; PAYLOAD_LEN];
    let mut sink = Sink::new(0, &mut payload);
    // The field wraps after 49 days.
    sink.put(&quotient(now_us, 1000).to_le_bytes());
    sink.put(&GENERAL_CHECKSUM.to_le_bytes());
    if id == COMPONENT_INFORMATION_ID {
        // The checksum of the peripherals' metadata, of which there is none.
        sink.put(&[0; 4]);
    }
    sink.put(GENERAL_URI.as_bytes());
    payload
}
