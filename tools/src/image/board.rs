//! The boards that have images.

use std::ops::Range;

use clap::ValueEnum;

/// A board, named after its firmware feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Board {
    /// ST's B-G431B-ESC1.
    #[value(name = "b-g431b-esc1")]
    BG431bEsc1,
    /// A board of the VESC 4.10 class.
    #[value(name = "vesc4-f405")]
    Vesc4F405,
}

impl Board {
    /// Returns the board of that name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        let mut boards = Self::value_variants().iter().copied();
        boards.find(|board| board.name() == name)
    }

    /// Returns its name.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::BG431bEsc1 => "b-g431b-esc1",
            Self::Vesc4F405 => "vesc4-f405",
        }
    }

    /// Returns the name of the PWM interrupt's vector.
    pub(crate) fn pwm_interrupt(self) -> &'static str {
        match self {
            Self::BG431bEsc1 => "ADC1_2",
            Self::Vesc4F405 => "ADC",
        }
    }

    /// Returns probe-rs's name for its chip.
    pub(crate) fn chip(self) -> &'static str {
        match self {
            Self::BG431bEsc1 => "STM32G431CBUx",
            Self::Vesc4F405 => "STM32F405RGTx",
        }
    }

    /// Returns the addresses that an image may use, as in the firmware's linker scripts. Stored data lie
    /// behind them on one board, and in a hole in the image on the other.
    pub(crate) fn flash(self) -> Range<u32> {
        match self {
            Self::BG431bEsc1 => 0x0800_0000..0x0801_F000,
            Self::Vesc4F405 => 0x0800_0000..0x0810_0000,
        }
    }

    /// Returns whether its images have every part of the drive; another board's flash has no room for all.
    pub(crate) fn has_all_parts(self) -> bool {
        self == Self::Vesc4F405
    }

    /// Returns whether the chip's own bootloader can be reached by USB. The other board's USB pins drive
    /// its bridge and its CAN bus.
    pub(crate) fn has_usb(self) -> bool {
        self == Self::Vesc4F405
    }
}
