//! The checksum of stored sets and of files, as MAVLink's file transfer has it.

/// CRC-32 of IEEE 802.3, reflected, which begins at 0 and is not inverted at its end, so that a
/// file's checksum goes on from that of what is before it (NuttX's `crc32part`, which PX4, ArduPilot
/// and mavros use).
pub(crate) const fn checksum(before: u32, bytes: &[u8]) -> u32 {
    let mut sum = before;
    let mut at = 0;
    while at < bytes.len() {
        sum ^= bytes[at] as u32;
        let mut bit = 0;
        while bit < 8 {
            sum = (sum >> 1) ^ (0xEDB8_8320 * (sum & 1));
            bit += 1;
        }
        at += 1;
    }
    sum
}
