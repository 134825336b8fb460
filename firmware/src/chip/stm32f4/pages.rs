//! Words and sectors of the flash (RM0090, section 3.6).

use embassy_stm32::pac::flash::regs::Cr;
use embassy_stm32::pac::flash::vals::Psize;

/// Bytes programmed at once.
pub(crate) const WORD_BYTES: usize = 4;

/// Bytes erased at once, in the sectors 0 to 3: it takes a quarter to half a second.
pub(crate) const PAGE_BYTES: usize = 0x4000;

/// The control register while words are programmed.
pub(crate) fn programming() -> Cr {
    let mut control = Cr(0);
    control.set_pg(true);
    control.set_psize(Psize::PSIZE32);
    control
}

/// The control register before one of the sectors 0 to 3 is erased.
pub(crate) fn erasing(sector: usize) -> Cr {
    let mut control = Cr(0);
    control.set_ser(true);
    control.set_snb(sector as u8);
    control.set_psize(Psize::PSIZE32);
    control
}

/// This flash has no error correction that could report a torn word.
pub(crate) fn take_torn_word() -> bool {
    false
}
