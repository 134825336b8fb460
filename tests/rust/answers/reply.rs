//! A flight controller's decoder for replies, written from the protocol's description rather than from the
//! control's encoder.

/// Each nibble with its five-bit code on the wire.
const GROUPS: [(u16, &str); 16] = [
    (0x0, "11001"),
    (0x1, "11011"),
    (0x2, "10010"),
    (0x3, "10011"),
    (0x4, "11101"),
    (0x5, "10101"),
    (0x6, "10110"),
    (0x7, "10111"),
    (0x8, "11010"),
    (0x9, "01001"),
    (0xA, "01010"),
    (0xB, "01011"),
    (0xC, "11110"),
    (0xD, "01101"),
    (0xE, "01110"),
    (0xF, "01111"),
];

/// What a reply says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Reply {
    Stopped,
    /// The electrical period and its step, µs.
    Turn {
        period_us: u32,
        step_us: u32,
    },
    /// The first digit and the last two digits of an extended telemetry word.
    Extended(u16, u8),
}

impl Reply {
    /// Decodes the line's 21 levels, first level first.
    pub(super) fn of_levels(levels: &[bool]) -> Self {
        assert_eq!(levels.len(), 21);
        assert!(!levels[0], "the start bit is low");
        let toggles: String = levels
            .windows(2)
            .map(|two| if two[0] == two[1] { '0' } else { '1' })
            .collect();
        let nibbles = toggles.as_bytes().chunks(5).map(|group| {
            let known = GROUPS.iter().find(|(_, code)| code.as_bytes() == group);
            known.unwrap_or_else(|| panic!("{toggles} is no code")).0
        });
        let nibbles: Vec<u16> = nibbles.collect();
        let sum = nibbles.iter().fold(0, |sum, nibble| sum ^ nibble);
        assert_eq!(sum, 0xF, "{nibbles:x?}: the check sum is inverted");
        Self::of_data(nibbles[0] << 8 | nibbles[1] << 4 | nibbles[2])
    }

    fn of_data(data: u16) -> Self {
        let (exponent, mantissa) = (data >> 9, u32::from(data & 0x1FF));
        if data == 0xFFF {
            Self::Stopped
        } else if exponent > 0 && mantissa < 0x100 {
            Self::Extended(data >> 8, data as u8)
        } else {
            Self::Turn {
                period_us: mantissa << exponent,
                step_us: 1 << exponent,
            }
        }
    }
}

/// Returns the levels of the datagram's number, starting with bit 20.
pub(super) fn levels(bits: u32) -> Vec<bool> {
    assert!(bits < 1 << 21);
    (0..21).rev().map(|bit| bits >> bit & 1 != 0).collect()
}

#[test]
fn a_reply_worked_out_by_hand_is_read() {
    // 0x9A1: 417·2^4 µs. The exclusive-or of 9, A and 1 is 2, so the checksum is D: 01001 01010 11011
    // 01101.
    let mut level = false;
    let toggled = "01001010101101101101".chars().map(|bit| {
        level ^= bit == '1';
        level
    });
    let wire: Vec<bool> = [false].into_iter().chain(toggled).collect();
    let told = Reply::Turn {
        period_us: 6672,
        step_us: 16,
    };
    assert_eq!(Reply::of_levels(&wire), told);
}
