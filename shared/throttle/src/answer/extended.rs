//! Extended DShot telemetry 2.0.0, in the words that no normalised speed uses
//! (<https://github.com/bird-sanctuary/extended-dshot-telemetry>).

/// The contents of an extended word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extended {
    /// Temperature, °C.
    Temperature(u8),
    /// Supply voltage, 0.25 V.
    Voltage(u8),
    /// Supply current, A.
    Current(u8),
    /// First debug value, for the ESC's developer; Siskin sends neither.
    Debug1(u8),
    /// Second debug value.
    Debug2(u8),
    /// The effort to keep the motor turning: 0 none, 255 cannot be done.
    Stress(u8),
    /// Events since the last status word; see [`Status`]. Also announces that extended telemetry is on
    /// ([`ENABLED`]) or off ([`DISABLED`]).
    Status(u8),
}

/// Reply to the command that turns extended telemetry on. Betaflight accepts no other.
pub const ENABLED: Extended = Extended::Status(0);

/// Reply to the command that turns it off.
pub const DISABLED: Extended = Extended::Status(0xFF);

/// The events in [`Extended::Status`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Bit 7: an event worth counting.
    pub alert: bool,
    /// Bit 6: something suspect.
    pub warning: bool,
    /// Bit 5: a serious problem.
    pub error: bool,
    /// Bits 3 to 0: maximum stress in sixteenths of its range. The specification says bits 3 to 1 for 0 to 15;
    /// Bluejay sends and ArduPilot reads four bits.
    pub max_stress: u8,
}

impl Extended {
    /// Encodes the 12 data bits.
    pub const fn data(self) -> u16 {
        let (kind, value) = match self {
            Self::Temperature(value) => (0x2, value),
            Self::Voltage(value) => (0x4, value),
            Self::Current(value) => (0x6, value),
            Self::Debug1(value) => (0x8, value),
            Self::Debug2(value) => (0xA, value),
            Self::Stress(value) => (0xC, value),
            Self::Status(value) => (0xE, value),
        };
        kind << 8 | value as u16
    }

    /// Decodes 12 data bits; `None` if they are a speed.
    pub const fn from_data(data: u16) -> Option<Self> {
        let value = data as u8;
        Some(match data >> 8 & 0xF {
            0x2 => Self::Temperature(value),
            0x4 => Self::Voltage(value),
            0x6 => Self::Current(value),
            0x8 => Self::Debug1(value),
            0xA => Self::Debug2(value),
            0xC => Self::Stress(value),
            0xE => Self::Status(value),
            _ => return None,
        })
    }
}

impl Status {
    /// Encodes the status word.
    pub const fn word(self) -> Extended {
        Extended::Status(
            (self.alert as u8) << 7
                | (self.warning as u8) << 6
                | (self.error as u8) << 5
                | self.max_stress & 0xF,
        )
    }

    /// Decodes the value of a status word.
    pub const fn from_value(value: u8) -> Self {
        Self {
            alert: value & 1 << 7 != 0,
            warning: value & 1 << 6 != 0,
            error: value & 1 << 5 != 0,
            max_stress: value & 0xF,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_are_those_of_the_specification() {
        assert_eq!(Extended::Temperature(25).data(), 0x219);
        assert_eq!(Extended::Voltage(96).data(), 0x460);
        assert_eq!(Extended::Current(7).data(), 0x607);
        assert_eq!(Extended::Stress(255).data(), 0xCFF);
        assert_eq!(ENABLED.data(), 0xE00);
        assert_eq!(DISABLED.data(), 0xEFF);
        let status = Status {
            alert: true,
            warning: false,
            error: true,
            max_stress: 9,
        };
        assert_eq!(status.word().data(), 0xEA9);
        assert_eq!(Status::from_value(0xA9), status);
    }

    #[test]
    fn a_word_is_extended_or_a_speed() {
        for data in 0..=0xFFF_u16 {
            let extended = data >> 8 != 0 && data & 0x100 == 0;
            match Extended::from_data(data) {
                Some(word) => assert_eq!((word.data(), extended), (data, true)),
                None => assert!(!extended, "{data:03x}"),
            }
        }
    }
}
