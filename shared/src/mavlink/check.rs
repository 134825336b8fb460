//! The seeds of the messages' checksums.
//!
//! Each message's checksum has its own seed. A receiver must know those of the whole dialect, not only of the messages
//! that an ESC obeys: otherwise it would find frames inside another message's payload (a file, a tunnel). The dialect's
//! own look-up takes 2.7 KB of flash, these tables a quarter of that; a test compares the two.

/// The first message of each span, and the `CRC_EXTRA` of it and those that follow; 0 where there is no message.
const SPANS: &[(u32, &[u8])] = &[
    (
        0,
        &[
            50, 124, 137, 0, 237, 217, 104, 119, 117, 0, 0, 89, 0, 0, 0, 0, 0, 0, 0, 0, 214, 159,
            220, 168, 24, 23, 170, 144, 67, 115, 39, 246, 185, 104, 237, 244, 222, 212, 9, 254,
            230, 28, 28, 132, 221, 232, 11, 153, 41, 39, 78, 196, 0, 0, 15, 3, 0, 0, 0, 0, 0, 167,
            183, 119, 191, 118, 148, 21, 0, 243, 124, 0, 0, 38, 20, 158, 152, 143, 0, 0, 14, 106,
            49, 22, 143, 140, 5, 150, 0, 231, 183, 63, 54, 47, 0, 0, 0, 0, 0, 0, 175, 102, 158,
            208, 56, 93, 138, 108, 32, 185, 84, 34, 174, 124, 237, 4, 76, 128, 56, 116, 134, 237,
            203, 250, 87, 203, 220, 25, 226, 46, 29, 223, 85, 6, 229, 203, 1, 195, 109, 168, 181,
            47, 72, 131, 127, 0, 103, 154, 178, 200, 134, 219, 208, 188, 84, 22, 19, 21, 134, 0,
            78, 68, 189, 127, 154, 21, 21, 144, 1, 234, 73, 181, 22, 83, 167, 138, 234, 240, 47,
            189, 52, 174, 229, 85, 159, 186, 72, 0, 0, 0, 0, 92, 36, 71, 98, 120, 0, 0, 0, 0, 134,
            205, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 69, 101, 50, 202, 17, 162, 0, 0, 0, 0, 0, 208,
            207, 0, 0, 0, 163, 105, 151, 35, 150, 179, 0, 0, 0, 0, 0, 90, 104, 85, 95, 130, 184,
            81, 8, 204, 49, 170, 44, 83, 46, 0, 71, 131, 187, 92, 146, 179, 12, 133, 49, 26, 193,
            35, 14, 109, 59, 22, 0, 0, 0, 126, 18, 62, 0, 0, 70, 48, 123, 74, 99, 137, 210, 1, 20,
            0, 251, 10, 0, 0, 0, 234, 158, 0, 0, 19, 217, 243, 0, 0, 0, 0, 0, 0, 0, 0, 28, 95, 0,
            0, 0, 0, 0, 0, 0, 0, 243, 88, 243, 78, 132, 0, 0, 0, 0, 0, 23, 91, 236, 231, 72, 225,
            245, 0, 0, 199, 99, 0, 0, 0, 0, 209, 0, 0, 0, 0, 232, 0, 0, 0, 0, 0, 0, 0, 0, 0, 11,
            93, 0, 0, 0, 0, 0, 0, 0, 0, 75, 10, 26, 117, 0, 251, 199, 0, 0, 0, 232, 0, 0, 0, 0,
            147, 132, 4, 8, 0, 156, 0, 0, 0, 0, 0, 50, 182, 0, 0, 110, 183, 0, 0, 0, 0, 0, 0, 0, 0,
            160, 106, 33, 77, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 134,
            193, 30, 0, 0, 66,
        ],
    ),
    (9000, &[113, 0, 0, 0, 0, 117]),
    (10_001, &[209, 186, 4, 133, 103, 193, 71, 240]),
    (10_151, &[195]),
    (
        11_000,
        &[
            134, 15, 234, 64, 11, 93, 0, 0, 0, 0, 46, 106, 0, 0, 0, 0, 0, 0, 0, 0, 205, 0, 0, 0, 0,
            0, 0, 0, 0, 0, 144, 133, 85, 195, 79, 128, 177, 130, 47, 142, 132, 208, 201, 193, 189,
            0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 162,
        ],
    ),
    (
        12_900,
        &[
            114, 254, 140, 249, 77, 49, 0, 0, 0, 0, 0, 0, 0, 0, 0, 94, 0, 0, 139, 7, 20,
        ],
    ),
    (42_000, &[227, 239]),
    (50_001, &[246, 181, 62, 240, 152]),
    (52_000, &[13, 239]),
];

/// Computes the checksum of a frame's bytes after the first (CRC-16/MCRF4XX), with its message's seed. The usual table
/// would take half a kilobyte of flash.
pub(super) fn of(bytes: &[u8], extra_crc: u8) -> u16 {
    bytes.iter().chain([&extra_crc]).fold(0xFFFF, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte), |crc, _| {
            crc >> 1 ^ if crc & 1 != 0 { 0x8408 } else { 0 }
        })
    })
}

/// Returns the seed of a message; 0 if the dialect lacks it.
pub(super) fn extra_crc(message: u32) -> u8 {
    let seed = |(first, seeds): &(u32, &'static [u8])| {
        let index = usize::try_from(message.checked_sub(*first)?).ok()?;
        seeds.get(index).copied()
    };
    SPANS.iter().find_map(seed).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mavlink::Message;
    use mavlink::dialects::ardupilotmega::MavMessage;

    #[test]
    fn checks_are_those_of_the_protocol() {
        let bytes: [u8; 255] = core::array::from_fn(|at| (at * 89) as u8);
        for len in 0..bytes.len() {
            let wanted = mavlink::calculate_crc(&bytes[..len], bytes[len]);
            assert_eq!(of(&bytes[..len], bytes[len]), wanted);
        }
    }

    #[test]
    fn seeds_are_those_of_the_dialect() {
        let last = MavMessage::all_ids().iter().copied().max().unwrap_or(0);
        assert!(last > 50_000, "{last}");
        for message in 0..=last + 1 {
            let wanted = MavMessage::extra_crc(message);
            assert_eq!(extra_crc(message), wanted, "{message}");
        }
        assert_eq!(extra_crc(0xFF_FFFF), 0);
    }
}
