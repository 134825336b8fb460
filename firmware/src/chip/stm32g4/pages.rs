//! Words and pages of the flash (RM0440, section 3.3).

use embassy_stm32::pac::FLASH;
use embassy_stm32::pac::flash::regs::Cr;

/// Bytes programmed at once.
pub(crate) const WORD_BYTES: usize = 8;

/// Bytes erased at once: 22 ms.
pub(crate) const PAGE_BYTES: usize = 2048;

/// The control register while words are programmed.
pub(crate) fn programming() -> Cr {
    let mut control = Cr(0);
    control.set_pg(true);
    control
}

/// The control register before a page is erased.
pub(crate) fn erasing(page: usize) -> Cr {
    let mut control = Cr(0);
    control.set_per(true);
    control.set_pnb(page as u8);
    control
}

/// Returns true if a word of the main flash was read that has two wrong bits or more, as one that a
/// loss of power has cut off, and clears the flag for the next one. The word reads as it is.
///
/// Which word it was is not looked at: RM0440 (3.7.7) does not say whether ADDR_ECC counts bytes or double
/// words.
pub(crate) fn take_torn_word() -> bool {
    let status = FLASH.eccr().read();
    // Flags are removed by ones.
    FLASH.eccr().write_value(status);
    status.eccd() && !status.sysf_ecc()
}
