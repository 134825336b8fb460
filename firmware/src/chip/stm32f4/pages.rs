//! Flash words and sectors (RM0090, section 3.6).

use embassy_stm32::pac::PWR;
use embassy_stm32::pac::flash::regs::Cr;
use embassy_stm32::pac::flash::vals::Psize;

/// Bytes programmed at once.
pub(crate) const WORD_BYTES: usize = 4;

/// Bytes erased at once, in sectors 0 to 3: takes a quarter to half a second.
pub(crate) const PAGE_BYTES: usize = 0x4000;

/// Returns the control register's value for programming words.
pub(crate) fn programming() -> Cr {
    let mut control = Cr(0);
    control.set_pg(true);
    control.set_psize(Psize::PSIZE32);
    control
}

/// Returns the control register's value for erasing one of sectors 0 to 3.
pub(crate) fn erasing(sector: usize) -> Cr {
    let mut control = Cr(0);
    control.set_ser(true);
    control.set_snb(sector as u8);
    control.set_psize(Psize::PSIZE32);
    control
}

/// Turns the supply's detector on, at 2.9 V: the highest of its levels, the next of which may be below the 2.7 V that
/// words need to be programmed at once (RM0090, PWR_CR.PLS; program and erase parallelism). The VESC firmware asks the
/// same detector how wide it may program.
pub(crate) fn watch_supply() {
    PWR.cr1().modify(|w| {
        w.set_pls(7);
        w.set_pvde(true);
    });
}

/// Returns true if the supply is below what programming needs.
pub(crate) fn supply_is_low() -> bool {
    PWR.csr1().read().pvdo()
}

/// Returns false: this flash has no ECC that could report a torn word.
pub(crate) fn take_torn_word() -> bool {
    false
}
