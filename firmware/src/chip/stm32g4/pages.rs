//! Words and pages of the flash (RM0440, section 3.3).

use embassy_stm32::pac::flash::regs::Cr;

/// What is programmed at once.
pub(crate) const WORD_BYTES: usize = 8;

/// What is erased at once: 22 ms.
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
