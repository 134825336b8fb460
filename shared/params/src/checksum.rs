//! Checksum of stored sets and of files, as MAVLink FTP defines it.

/// Returns the IEEE 802.3 CRC-32, reflected, with initial value 0 and no final inversion, so that it continues
/// over consecutive parts (NuttX's `crc32part`, used by PX4, ArduPilot and mavros).
pub const fn checksum(before: u32, bytes: &[u8]) -> u32 {
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
