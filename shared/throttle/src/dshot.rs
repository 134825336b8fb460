//! DShot frames: 16 bits, most significant first, each a pulse whose width is its value.
//!
//! 11 bits are the value, one requests telemetry, four are a checksum.

use super::{Share, reverse};

/// The lowest throttle value; below are stop (0) and the commands.
const FIRST_THROTTLE: u16 = 48;
/// The highest value of a frame.
const LAST_THROTTLE: u16 = 2047;
/// The lowest value of the second direction, when throttle has two.
const FIRST_FORWARD: u16 = 1048;

/// Returns the bits to flip in a frame: bidirectional DShot inverts all four checksum bits.
pub const fn check_mask(bidirectional: bool) -> u16 {
    if bidirectional { 0xF } else { 0 }
}

/// The contents of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// 0 stop, 1 to 47 commands, 48 to 2047 throttle; higher bits are not sent.
    pub value: u16,
    /// The sender requests telemetry.
    pub telemetry: bool,
}

/// What a frame's value means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Stop the motor: value 0.
    Stop,
    /// A command, 1 to 47. It counts as zero throttle.
    Command(u8),
    /// Turn: values 48 to 2047, linear from 0 to 1. With two directions, 48 to 1047 are reverse and 1048 to
    /// 2047 forward.
    Throttle(Share),
}

impl Frame {
    /// Decodes the 16 bits on the wire; returns `None` if the checksum does not match.
    pub fn from_bits(bits: u16) -> Option<Self> {
        let data = bits >> 4;
        (bits & 0xF == check_sum(data)).then_some(Self {
            value: data >> 1,
            telemetry: data & 1 != 0,
        })
    }

    /// Encodes the frame as the 16 bits on the wire.
    pub fn to_bits(self) -> u16 {
        let data = (self.value & LAST_THROTTLE) << 1 | u16::from(self.telemetry);
        data << 4 | check_sum(data)
    }

    /// Returns true for a command, values 1 to 47.
    pub fn is_command(self) -> bool {
        (1..FIRST_THROTTLE).contains(&self.value)
    }

    /// Returns what the value means with one throttle direction or two (`INP_3D`).
    pub fn kind(self, two_directions: bool) -> Kind {
        match self.value {
            0 => Kind::Stop,
            command if command < FIRST_THROTTLE => Kind::Command(command as u8),
            value if !two_directions => Kind::Throttle(share(value, FIRST_THROTTLE, LAST_THROTTLE)),
            value if value < FIRST_FORWARD => {
                Kind::Throttle(reverse(share(value, FIRST_THROTTLE, FIRST_FORWARD - 1)))
            }
            value => Kind::Throttle(share(value, FIRST_FORWARD, LAST_THROTTLE)),
        }
    }
}

/// Returns the position of `value` between `first` and `last`, as a share.
fn share(value: u16, first: u16, last: u16) -> Share {
    let (step, steps) = (u32::from(value.min(last) - first), u32::from(last - first));
    // step·2^31/steps in 32-bit arithmetic, from quotient and remainder of 2^31/steps.
    let whole = (1 << Share::FRAC_NBITS) / steps;
    let rest = (1 << Share::FRAC_NBITS) % steps;
    let share = step * whole + step * rest / steps;
    Share::from_bits(share.min(i32::MAX as u32) as i32)
}

/// Returns the four check bits of 12 data bits: the XOR of their nibbles.
pub const fn check_sum(data: u16) -> u16 {
    (data ^ data >> 4 ^ data >> 8) & 0xF
}

/// A DShot bit rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// 150 kbit/s.
    Dshot150,
    /// 300 kbit/s.
    Dshot300,
    /// 600 kbit/s.
    Dshot600,
    /// 1200 kbit/s.
    Dshot1200,
}

impl Rate {
    /// Every rate, slowest first.
    pub const ALL: [Self; 4] = [
        Self::Dshot150,
        Self::Dshot300,
        Self::Dshot600,
        Self::Dshot1200,
    ];

    /// Returns the bit rate in bits per second.
    pub const fn bit_hz(self) -> u32 {
        match self {
            Self::Dshot150 => 150_000,
            Self::Dshot300 => 300_000,
            Self::Dshot600 => 600_000,
            Self::Dshot1200 => 1_200_000,
        }
    }

    /// Returns the duration of a bit, ns: 6667, 3333, 1667 or 833.
    pub const fn bit_ns(self) -> u32 {
        self.eighths_ns(8)
    }

    /// Returns the time from a frame's first edge to the end of its 16th bit, ns.
    pub const fn frame_ns(self) -> u32 {
        self.eighths_ns(16 * 8)
    }

    /// Converts eighths of a bit to ns, rounded to nearest: no bit is a whole number of them.
    pub const fn eighths_ns(self, eighths: u32) -> u32 {
        // 10⁹/8 over the rate is 5000/6, 2500/6, 1250/6 or 625/6.
        (eighths * (750_000_000 / self.bit_hz()) + 3) / 6
    }
}

/// Returns the 32 edges of a frame with these bits, checksum included: time since the first edge in ns, and the
/// level from then on. A one is high for 75 % of its bit, a zero for 37.5 %.
pub fn edges(bits: u16, rate: Rate) -> impl Iterator<Item = (u32, bool)> {
    (0..16_u32).flat_map(move |bit| {
        let high_eighths = if bits << bit & 0x8000 != 0 { 6 } else { 3 };
        [
            (rate.eighths_ns(bit * 8), true),
            (rate.eighths_ns(bit * 8 + high_eighths), false),
        ]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    #[test]
    fn known_frames() {
        // Value 1046 with telemetry is the example in the protocol's first description.
        let frame = Frame {
            value: 1046,
            telemetry: true,
        };
        assert_eq!(frame.to_bits(), 0b1000_0010_1101_0111);
        assert_eq!(Frame::from_bits(0b1000_0010_1101_0111), Some(frame));
        assert_eq!(
            Frame::from_bits(0),
            Some(Frame {
                value: 0,
                telemetry: false
            })
        );
    }

    #[test]
    fn of_all_words_one_in_sixteen_is_a_frame_and_comes_back() {
        let frames: Vec<u16> = (0..=u16::MAX)
            .filter(|&bits| Frame::from_bits(bits).is_some())
            .collect();
        assert_eq!(frames.len(), 4096);
        for bits in frames {
            assert_eq!(Frame::from_bits(bits).map(Frame::to_bits), Some(bits));
            for flipped in 0..16 {
                assert_eq!(Frame::from_bits(bits ^ 1 << flipped), None, "{bits:04x}");
            }
        }
    }

    #[test]
    fn values_are_stop_commands_and_throttle() {
        let kind = |value| {
            Frame {
                value,
                telemetry: false,
            }
            .kind(false)
        };
        assert_eq!(kind(0), Kind::Stop);
        assert_eq!(kind(1), Kind::Command(1));
        assert_eq!(kind(47), Kind::Command(47));
        assert_eq!(kind(48), Kind::Throttle(Share::ZERO));
        assert_eq!(kind(2047), Kind::Throttle(Share::MAX));
        assert_eq!(kind(u16::MAX), Kind::Throttle(Share::MAX));
        for value in 48..=2047 {
            let Kind::Throttle(throttle) = kind(value) else {
                panic!("{value} is no throttle");
            };
            let wanted = f64::from(value - 48) / 1999.0;
            assert!((throttle.to_num::<f64>() - wanted).abs() < 5e-10, "{value}");
        }
    }

    #[test]
    fn with_two_directions_each_half_begins_at_its_least_throttle() {
        let kind = |value| {
            Frame {
                value,
                telemetry: false,
            }
            .kind(true)
        };
        assert_eq!(kind(0), Kind::Stop);
        assert_eq!(kind(47), Kind::Command(47));
        assert_eq!(kind(48), Kind::Throttle(reverse(Share::ZERO)));
        assert_eq!(kind(1047), Kind::Throttle(reverse(Share::MAX)));
        assert_eq!(kind(1048), Kind::Throttle(Share::ZERO));
        assert_eq!(kind(2047), Kind::Throttle(Share::MAX));
        for step in 0..1000 {
            let wanted = f64::from(step) / 999.0;
            for (first, sign) in [(48, -1.0), (1048, 1.0)] {
                let Kind::Throttle(throttle) = kind(first + step) else {
                    panic!("{} is no throttle", first + step);
                };
                assert!((throttle.to_num::<f64>() * sign - wanted).abs() < 2e-9);
            }
        }
    }

    #[test]
    fn bit_times_are_those_of_the_protocol() {
        assert_eq!(Rate::ALL.map(Rate::bit_ns), [6667, 3333, 1667, 833]);
        assert_eq!(
            Rate::ALL.map(Rate::frame_ns),
            [106_667, 53_333, 26_667, 13_333]
        );
    }

    #[test]
    fn pulses_are_three_and_six_eighths_of_a_bit() {
        let played: Vec<_> = edges(0x8001, Rate::Dshot300).collect();
        assert_eq!(played.len(), 32);
        assert_eq!(played[..3], [(0, true), (2500, false), (3333, true)]);
        assert_eq!(played[3], (4583, false));
        assert_eq!(played[30..], [(50_000, true), (52_500, false)]);
    }

    proptest! {
        #[test]
        fn a_frame_comes_back(value in 0_u16..=2047, telemetry: bool) {
            let frame = Frame { value, telemetry };
            prop_assert_eq!(Frame::from_bits(frame.to_bits()), Some(frame));
        }
    }
}
