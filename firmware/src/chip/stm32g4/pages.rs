//! Flash words and pages (RM0440, section 3.3).

use embassy_stm32::pac::FLASH;
use embassy_stm32::pac::flash::regs::Cr;

/// Bytes programmed at once.
pub(crate) const WORD_BYTES: usize = 8;

/// Bytes erased at once: takes 22 ms.
pub(crate) const PAGE_BYTES: usize = 2048;

/// Returns the control register's value for programming words.
pub(crate) fn programming() -> Cr {
    let mut control = Cr(0);
    control.set_pg(true);
    control
}

/// Returns the control register's value for erasing a page.
pub(crate) fn erasing(page: usize) -> Cr {
    let mut control = Cr(0);
    control.set_per(true);
    control.set_pnb(page as u8);
    control
}

/// Returns true if a word with two or more wrong bits was read from main flash, as one torn by a loss of power,
/// and clears the flag for the next. The word reads as it is.
///
/// It does not check which word it was: RM0440 (3.7.7) does not say whether ADDR_ECC counts bytes or double
/// words.
pub(crate) fn take_torn_word() -> bool {
    let status = FLASH.eccr().read();
    // Writing 1 clears flags.
    FLASH.eccr().write_value(status);
    status.eccd() && !status.sysf_ecc()
}

/// Returns false: this flash can be programmed wherever the chip runs (DS12589, operating conditions).
pub(crate) const fn supply_is_low() -> bool {
    false
}
