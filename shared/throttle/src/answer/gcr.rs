//! Line code of a reply: 12 data bits as 21 levels on the wire.
//!
//! Four check bits follow the data. Each nibble maps to a five-bit group without long runs of zeros, and every
//! one toggles the line, starting from a low start bit. Betaflight and ArduPilot decode it this way, and reject
//! a word whose nibbles, check bits included, do not XOR to 0xF.

/// The group code of each nibble.
const CODE: [u8; 16] = [
    0x19, 0x1B, 0x12, 0x13, 0x1D, 0x15, 0x16, 0x17, 0x1A, 0x09, 0x0A, 0x0B, 0x1E, 0x0D, 0x0E, 0x0F,
];

/// The nibble of each group code, [`NONE`] if invalid.
const NIBBLE: [u8; 32] = nibbles();
const NONE: u8 = 0xFF;

/// Levels in a reply.
pub const BITS: u32 = 21;

const fn nibbles() -> [u8; 32] {
    let mut nibbles = [NONE; 32];
    let mut nibble = 0;
    while nibble < CODE.len() {
        nibbles[CODE[nibble] as usize] = nibble as u8;
        nibble += 1;
    }
    nibbles
}

/// Encodes 12 data bits as 21 levels: bit 20, the start bit, comes first; 1 is high. The last level is high in
/// every reply: a group has even parity exactly where its nibble's lowest three bits have odd parity, and the
/// check bits make that so for an odd number of the four nibbles.
pub fn encode(data: u16) -> u32 {
    let data = data & 0xFFF;
    let word = data << 4 | check_sum(data);
    let code = (0..4).rev().fold(0, |code, place| {
        code << 5 | u32::from(CODE[usize::from(word >> (4 * place) & 0xF)])
    });
    // Each level is the XOR of all bits up to its own.
    let mut levels = code;
    for shift in [1, 2, 4, 8, 16] {
        levels ^= levels >> shift;
    }
    levels
}

/// Decodes 21 levels to 12 data bits; `None` if they are not a valid reply.
pub fn decode(levels: u32) -> Option<u16> {
    if levels >> (BITS - 1) != 0 {
        return None;
    }
    let code = levels ^ levels >> 1;
    let word = (0..4).rev().try_fold(0_u16, |word, place| {
        let nibble = NIBBLE[(code >> (5 * place) & 0x1F) as usize];
        (nibble != NONE).then_some(word << 4 | u16::from(nibble))
    })?;
    let data = word >> 4;
    (word & 0xF == check_sum(data)).then_some(data)
}

/// Returns the complement of the XOR of the three nibbles.
fn check_sum(data: u16) -> u16 {
    !(data ^ data >> 4 ^ data >> 8) & 0xF
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reply_begins_low_and_ends_high() {
        for data in 0..0x1000 {
            let levels = encode(data);
            assert_eq!((levels >> (BITS - 1), levels & 1), (0, 1), "{data:#05x}");
        }
    }

    #[test]
    fn a_known_reply() {
        // 0x000 has checksum 0xF: 11001 11001 11001 01111, and the line toggles at each 1.
        assert_eq!(encode(0x000), 0b0_10001_01110_10001_10101);
        assert_eq!(decode(0b0_10001_01110_10001_10101), Some(0x000));
    }

    #[test]
    fn every_word_comes_back_and_holds_no_level_for_more_than_three_bits() {
        for data in 0..=0xFFF {
            let levels = encode(data);
            assert_eq!(decode(levels), Some(data));
            let changes = levels ^ levels >> 1;
            assert!((0..18).all(|bit| changes >> bit & 7 != 0), "{data:03x}");
        }
    }

    #[test]
    fn of_all_words_only_those_that_are_sent_are_replies() {
        let replies = (0..1 << BITS).filter(|levels| decode(*levels).is_some());
        assert_eq!(replies.count(), 4096);
        assert_eq!(decode(encode(5) | 1 << BITS), None);
    }
}
