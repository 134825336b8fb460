//! The boards that have images.

use std::ops::Range;

use clap::ValueEnum;

/// What the VESC's boards are named after, with what is printed on their shunts behind it. It is no board: an image that
/// takes other shunts for its own shows another current.
const VESC4: &str = "vesc4-f405";

/// A board, named after its firmware feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Board {
    /// ST's B-G431B-ESC1.
    #[value(name = "b-g431b-esc1")]
    BG431bEsc1,
    /// Boards of the VESC 4.10 class, 0.5 mΩ.
    #[value(name = "vesc4-f405-r0005")]
    Vesc4R0005,
    /// 1 mΩ.
    #[value(name = "vesc4-f405-r001")]
    Vesc4R001,
    /// 5 mΩ.
    #[value(name = "vesc4-f405-r005")]
    Vesc4R005,
}

impl Board {
    /// Returns the board of that name.
    ///
    /// # Errors
    /// What is wrong with an image for it.
    pub(crate) fn named(name: &str) -> Result<Self, String> {
        let all = Self::value_variants();
        if let Some(board) = all.iter().find(|board| board.name() == name) {
            return Ok(*board);
        }
        Err(if name == VESC4 {
            let boards = all[1..].iter().map(|board| board.name());
            let boards: Vec<_> = boards.collect();
            format!(
                "made for a VESC that does not say which shunts it has; make it for one of {}",
                boards.join(", ")
            )
        } else {
            format!("made for '{name}', a board that this program does not know")
        })
    }

    /// Returns its name.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::BG431bEsc1 => "b-g431b-esc1",
            Self::Vesc4R0005 => "vesc4-f405-r0005",
            Self::Vesc4R001 => "vesc4-f405-r001",
            Self::Vesc4R005 => "vesc4-f405-r005",
        }
    }

    fn is_vesc4(self) -> bool {
        self != Self::BG431bEsc1
    }

    /// Returns the name of the PWM interrupt's vector.
    pub(crate) fn pwm_interrupt(self) -> &'static str {
        if self.is_vesc4() { "ADC" } else { "ADC1_2" }
    }

    /// Returns probe-rs's name for its chip.
    pub(crate) fn chip(self) -> &'static str {
        if self.is_vesc4() {
            "STM32F405RGTx"
        } else {
            "STM32G431CBUx"
        }
    }

    /// Returns the addresses that an image may use, as in the firmware's linker scripts. Stored data lie
    /// behind them on one board, and in a hole in the image on the others.
    pub(crate) fn flash(self) -> Range<u32> {
        if self.is_vesc4() {
            0x0800_0000..0x0810_0000
        } else {
            0x0800_0000..0x0801_F000
        }
    }

    /// Returns whether its images have every part of the drive; another board's flash has no room for all.
    pub(crate) fn has_all_parts(self) -> bool {
        self.is_vesc4()
    }

    /// Returns whether the chip's own bootloader can be reached by USB. The other board's USB pins drive
    /// its bridge and its CAN bus.
    pub(crate) fn has_usb(self) -> bool {
        self.is_vesc4()
    }
}
