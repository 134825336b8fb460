//! The signals a throttle wire may carry.

use super::dshot::Rate;

/// A kind of pulse whose width is the throttle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pulse {
    /// 1000 to 2000 µs, 50 to 490 times a second.
    Servo,
    /// 125 to 250 µs.
    OneShot125,
    /// 42 to 84 µs.
    OneShot42,
    /// 5 to 25 µs.
    Multishot,
}

impl Pulse {
    /// Every kind, longest first.
    pub const ALL: [Self; 4] = [
        Self::Servo,
        Self::OneShot125,
        Self::OneShot42,
        Self::Multishot,
    ];

    /// Returns the nominal widths of minimum and maximum throttle, ns.
    pub const fn end_points_ns(self) -> EndPointsNs {
        let (least, most) = match self {
            Self::Servo => (1_000_000, 2_000_000),
            Self::OneShot125 => (125_000, 250_000),
            Self::OneShot42 => (42_000, 84_000),
            Self::Multishot => (5_000, 25_000),
        };
        EndPointsNs { least, most }
    }
}

/// The widths of minimum and maximum throttle, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EndPointsNs {
    /// Minimum throttle.
    pub least: u32,
    /// Maximum throttle.
    pub most: u32,
}

/// A signal a wire may carry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// Pulses.
    Pulse(Pulse),
    /// DShot frames.
    Dshot {
        /// Bit rate.
        rate: Rate,
        /// The line rests high, the checksum is inverted and each frame is answered on the same wire.
        bidirectional: bool,
    },
}

/// Every signal with its number in `INP_PROTO` and its name.
const TABLE: [(Signal, u8, &str); 12] = [
    (Signal::Pulse(Pulse::Servo), 1, "servo"),
    (Signal::Pulse(Pulse::OneShot125), 2, "OneShot125"),
    (Signal::Pulse(Pulse::OneShot42), 3, "OneShot42"),
    (Signal::Pulse(Pulse::Multishot), 4, "Multishot"),
    (dshot(Rate::Dshot150, false), 10, "DShot150"),
    (dshot(Rate::Dshot300, false), 11, "DShot300"),
    (dshot(Rate::Dshot600, false), 12, "DShot600"),
    (dshot(Rate::Dshot1200, false), 13, "DShot1200"),
    (dshot(Rate::Dshot150, true), 20, "bidirectional DShot150"),
    (dshot(Rate::Dshot300, true), 21, "bidirectional DShot300"),
    (dshot(Rate::Dshot600, true), 22, "bidirectional DShot600"),
    (dshot(Rate::Dshot1200, true), 23, "bidirectional DShot1200"),
];

const fn dshot(rate: Rate, bidirectional: bool) -> Signal {
    Signal::Dshot {
        rate,
        bidirectional,
    }
}

impl Signal {
    /// Returns every signal, in numerical order.
    pub fn all() -> impl Iterator<Item = Self> {
        TABLE.iter().map(|(signal, ..)| *signal)
    }

    /// Returns the signal with this number in `INP_PROTO`, or `None` for 0, automatic detection.
    pub fn from_number(number: u8) -> Option<Self> {
        let row = TABLE.iter().find(|(_, other, _)| *other == number)?;
        Some(row.0)
    }

    /// Returns true if the line is high between frames.
    pub fn rests_high(self) -> bool {
        matches!(
            self,
            Self::Dshot {
                bidirectional: true,
                ..
            }
        )
    }

    /// Returns its number in `INP_PROTO`.
    pub fn number(self) -> u8 {
        self.row().1
    }

    /// Returns its name.
    pub fn name(self) -> &'static str {
        self.row().2
    }

    fn row(self) -> (Self, u8, &'static str) {
        let row = TABLE.iter().find(|(signal, ..)| *signal == self);
        *row.expect("the table has every signal")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_signals_belong_together() {
        assert_eq!(Signal::all().count(), 4 + 2 * Rate::ALL.len());
        for signal in Signal::all() {
            assert_eq!(Signal::from_number(signal.number()), Some(signal));
        }
        assert_eq!(Signal::from_number(0), None);
    }
}
