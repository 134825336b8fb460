//! The boards that there are images for.

use std::ops::Range;

use clap::ValueEnum;

/// A board, by the name of the firmware's feature for it.
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
    /// The board of that name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        let mut boards = Self::value_variants().iter().copied();
        boards.find(|board| board.name() == name)
    }

    /// Its name.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::BG431bEsc1 => "b-g431b-esc1",
            Self::Vesc4F405 => "vesc4-f405",
        }
    }

    /// The PWM interrupt, by the name of its vector.
    pub(crate) fn pwm_interrupt(self) -> &'static str {
        match self {
            Self::BG431bEsc1 => "ADC1_2",
            Self::Vesc4F405 => "ADC",
        }
    }

    /// What probe-rs calls its chip.
    pub(crate) fn chip(self) -> &'static str {
        match self {
            Self::BG431bEsc1 => "STM32G431CBUx",
            Self::Vesc4F405 => "STM32F405RGTx",
        }
    }

    /// The addresses that an image may take, as the firmware's linker scripts have them. What is
    /// stored lies behind them on the one board, and in a hole of the image on the other.
    pub(crate) fn flash(self) -> Range<u32> {
        match self {
            Self::BG431bEsc1 => 0x0800_0000..0x0801_F000,
            Self::Vesc4F405 => 0x0800_0000..0x0810_0000,
        }
    }

    /// Whether the chip's own loader can be reached by USB. The other board's USB pins drive its
    /// bridge and its CAN bus.
    pub(crate) fn has_usb(self) -> bool {
        self == Self::Vesc4F405
    }
}
