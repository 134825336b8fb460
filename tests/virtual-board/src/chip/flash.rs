//! The flash: its registers, and the store that the program writes (RM0440, 3.3 and 3.7).
//!
//! The rest of the array is read in place and never written. Programming a double word takes 81.7 µs and
//! erasing a page 22.02 ms, the typical times in DS12589 (at most 90 µs and 24.5 ms); the result appears
//! when that has passed. A read in the meantime, which would stall the processor, is refused.

mod array;

use std::ops::Range;

use stm32_metapac::Interrupt;
use stm32_metapac::flash::regs::{Acr, Cr, Eccr, Sr};

pub use array::Change;
use array::{Array, Work};

use super::{Context, Part, Signal, Unmodelled};
use crate::memory::Memory;
use crate::processor::Width;
use crate::time::{Cycles, NEVER, of_ns};

/// Start of the flash.
const ORIGIN: u32 = 0x0800_0000;

/// The keys that unlock the control register, in this order.
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];

/// Time to program a double word.
const PROGRAM_NS: u64 = 81_700;

/// Time to erase a page.
const ERASE_NS: u64 = 22_020_000;

/// Factory option bytes, except for nSWBOOT0: the board boots without reading its pin.
const OPTIONS: u32 = 0xffef_f8aa & !(1 << 26);

/// Whether the control register may be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lock {
    Closed,
    /// The first key has been written.
    Half,
    Open,
    /// A wrong key has been written: locked until a reset.
    Shut,
}

/// The part.
#[derive(Debug)]
pub struct Flash {
    array: Array,
    access: Acr,
    control: Cr,
    status: Sr,
    torn: Eccr,
    /// The option bytes.
    pub(crate) options: u32,
    /// Whether ADDR_ECC counts double words rather than bytes.
    torn_by_words: bool,
    /// How often the program has cleared ECCD.
    torn_removed: u32,
    lock: Lock,
    /// The first half of a double word, with its address.
    first: Option<(u32, u32)>,
    work: Option<(Work, Cycles)>,
    fails: bool,
    line: bool,
}

impl Flash {
    /// Creates the flash as after a reset. The store is a range of its memory.
    pub fn new(memory: Memory, store: Range<u32>) -> Self {
        Self::around(Array::new(memory, store))
    }

    fn around(array: Array) -> Self {
        let mut access = Acr(0);
        access.set_icen(true);
        access.set_dcen(true);
        access.set_dbg_swen(true);
        let mut control = Cr(0);
        control.set_optlock(true);
        Self {
            array,
            access,
            control,
            status: Sr(0),
            torn: Eccr(0),
            options: OPTIONS,
            torn_by_words: false,
            torn_removed: 0,
            lock: Lock::Closed,
            first: None,
            work: None,
            fails: false,
            line: false,
        }
    }

    /// Resets the registers, and interrupts any operation: what it was writing is torn, by this seed. A
    /// power failure does the same.
    pub fn reset(&mut self, seed: u64, context: &mut Context) {
        self.settle(context);
        if let Some((work, _)) = self.work.take() {
            self.array.tear(&work, seed);
        }
        let [line, torn] = [self.line, self.torn.eccd()];
        *self = Self {
            fails: self.fails,
            options: self.options,
            torn_by_words: self.torn_by_words,
            torn_removed: self.torn_removed,
            line,
            ..Self::around(self.array.clone())
        };
        if torn {
            context.signals.push(Signal::NonMaskable(false));
        }
        self.tell(context);
    }

    /// Makes every write and erase fail from now on, or no longer, as in a worn-out or protected flash.
    pub fn fail(&mut self, fails: bool) {
        self.fails = fails;
    }

    /// Makes ADDR_ECC count double words, or bytes as it does at first: RM0440 (3.7.7) does not say which
    /// one a chip does.
    pub fn tell_torn_by_words(&mut self, by_words: bool) {
        self.torn_by_words = by_words;
    }

    /// Returns how often the program has been told of a torn double word and has acknowledged it.
    pub fn torn_removed(&self) -> u32 {
        self.torn_removed
    }

    /// Returns until when the array cannot be read.
    pub fn busy_until(&self) -> Cycles {
        self.work.as_ref().map_or(0, |(_, ends)| *ends)
    }

    /// Returns the wait states of a read.
    pub fn wait_states(&self) -> u8 {
        self.access.latency().to_bits()
    }

    /// Returns whether it prefetches.
    pub fn prefetches(&self) -> bool {
        self.access.prften()
    }

    /// Takes what has changed in the store since the last call, in order.
    pub fn take_changes(&mut self) -> Vec<Change> {
        self.array.take_changes()
    }

    /// Reads the store. A torn double word reads as it is and raises the non-maskable interrupt.
    pub fn array_read(
        &mut self,
        address: u32,
        width: Width,
        context: &mut Context,
    ) -> Result<u32, Unmodelled> {
        self.settle(context);
        if self.work.is_some() {
            return Err(Unmodelled);
        }
        let value = self.array.read(address, width)?;
        // Only the first one is reported until its flag is cleared.
        if self.array.is_torn(address) && !self.torn.eccd() {
            let bytes = (address - ORIGIN) & !7;
            let counted = if self.torn_by_words { bytes / 8 } else { bytes };
            self.torn.set_addr_ecc(counted);
            self.torn.set_eccd(true);
            context.signals.push(Signal::NonMaskable(true));
        }
        Ok(value)
    }

    /// Writes the store: the second half of a double word programs it.
    pub fn array_write(
        &mut self,
        address: u32,
        width: Width,
        value: u32,
        context: &mut Context,
    ) -> Result<(), Unmodelled> {
        self.settle(context);
        if self.work.is_some() {
            return Err(Unmodelled);
        }
        let before = self.first.take();
        if !self.control.pg() || self.has_errors() {
            self.status.set_pgserr(true);
        } else if width != Width::Word {
            self.status.set_sizerr(true);
        } else if let Some((first, low)) = before {
            if address == first + 4 {
                self.program(first, u64::from(value) << 32 | u64::from(low), context)?;
            } else {
                self.status.set_pgaerr(true);
            }
        } else if address.is_multiple_of(8) {
            self.first = Some((address, value));
        } else {
            // The second half alone: the manual does not say what happens.
            return Err(Unmodelled);
        }
        self.tell(context);
        Ok(())
    }

    fn program(
        &mut self,
        address: u32,
        word: u64,
        context: &mut Context,
    ) -> Result<(), Unmodelled> {
        // Zeros may be written over anything.
        if self.fails {
            self.status.set_wrperr(true);
        } else if word != 0 && !self.array.is_erased(address)? {
            self.status.set_progerr(true);
        } else {
            let ends = context.now + of_ns(PROGRAM_NS);
            self.work = Some((Work::Program { address, word }, ends));
        }
        Ok(())
    }

    fn erase(&mut self, context: &mut Context) -> Result<(), Unmodelled> {
        if self.has_errors() {
            self.status.set_pgserr(true);
        } else if self.fails {
            self.status.set_wrperr(true);
        } else {
            let work = self.array.erase(self.control.pnb())?;
            self.work = Some((work, context.now + of_ns(ERASE_NS)));
        }
        Ok(())
    }

    /// Completes what is due.
    fn settle(&mut self, context: &mut Context) {
        if let Some((work, _)) = self.work.take_if(|(_, ends)| *ends <= context.now) {
            self.array.finish(&work);
            if self.control.eopie() {
                self.status.set_eop(true);
            }
            self.tell(context);
        }
    }

    /// Returns whether an error has not been cleared yet.
    fn has_errors(&self) -> bool {
        let mut errors = self.status;
        errors.set_eop(false);
        errors.0 != 0
    }

    fn tell(&mut self, context: &mut Context) {
        if self.control.errie() && self.has_errors() {
            self.status.set_operr(true);
        }
        let line = self.status.eop() && self.control.eopie()
            || self.status.operr() && self.control.errie();
        if line != self.line {
            self.line = line;
            let signal = Signal::Interrupt(Interrupt::FLASH as u16, line);
            context.signals.push(signal);
        }
    }

    fn write_access(&mut self, value: u32) -> Result<(), Unmodelled> {
        let access = Acr(value);
        // A cache is cleared only while off; the flash is never powered down.
        if access.icrst() && access.icen()
            || access.dcrst() && access.dcen()
            || access.run_pd()
            || access.sleep_pd()
        {
            return Err(Unmodelled);
        }
        self.access = access;
        Ok(())
    }

    fn write_key(&mut self, key: u32) -> Result<(), Unmodelled> {
        self.lock = match (self.lock, key) {
            (Lock::Closed, key) if key == KEYS[0] => Lock::Half,
            (Lock::Half, key) if key == KEYS[1] => Lock::Open,
            (Lock::Open, _) => return Err(Unmodelled),
            _ => Lock::Shut,
        };
        Ok(())
    }

    fn write_control(&mut self, value: u32, context: &mut Context) -> Result<(), Unmodelled> {
        // The bus would stall.
        if self.work.is_some() {
            return Err(Unmodelled);
        }
        if self.lock != Lock::Open {
            return Ok(());
        }
        let asked = Cr(value);
        let mut wanted = Cr(0);
        wanted.set_pg(asked.pg());
        wanted.set_per(asked.per());
        wanted.set_pnb(asked.pnb());
        wanted.set_eopie(asked.eopie());
        wanted.set_errie(asked.errie());
        let mut known = wanted;
        known.set_strt(asked.strt());
        known.set_lock(asked.lock());
        known.set_optlock(asked.optlock());
        // No mass erase, fast programming or option bytes.
        if known.0 != value || asked.strt() && !asked.per() {
            return Err(Unmodelled);
        }
        wanted.set_optlock(true);
        self.control = wanted;
        if !wanted.pg() {
            self.first = None;
        }
        if asked.pg() && asked.per() {
            self.status.set_pgserr(true);
        } else if asked.strt() {
            self.erase(context)?;
        }
        if asked.lock() {
            self.lock = Lock::Closed;
        }
        self.tell(context);
        Ok(())
    }

    fn write_torn(&mut self, value: u32, context: &mut Context) -> Result<(), Unmodelled> {
        let asked = Eccr(value);
        if asked.eccie() {
            return Err(Unmodelled);
        }
        // Flags are cleared by ones.
        if asked.eccd() && self.torn.eccd() {
            self.torn.set_eccd(false);
            self.torn_removed += 1;
            context.signals.push(Signal::NonMaskable(false));
        }
        Ok(())
    }
}

impl Part for Flash {
    fn read(&mut self, offset: u32, context: &mut Context) -> Result<u32, Unmodelled> {
        self.settle(context);
        match offset {
            0x00 => Ok(self.access.0),
            0x10 => {
                let mut status = self.status;
                status.set_bsy(self.work.is_some());
                Ok(status.0)
            }
            0x14 => {
                let mut control = self.control;
                control.set_strt(matches!(self.work, Some((Work::Erase { .. }, _))));
                control.set_lock(self.lock != Lock::Open);
                Ok(control.0)
            }
            0x18 => Ok(self.torn.0),
            0x20 => Ok(self.options),
            _ => Err(Unmodelled),
        }
    }

    fn write(&mut self, offset: u32, value: u32, context: &mut Context) -> Result<(), Unmodelled> {
        self.settle(context);
        match offset {
            0x00 => self.write_access(value),
            0x08 => self.write_key(value),
            0x10 => {
                // Flags are cleared by ones.
                self.status = Sr(self.status.0 & !value);
                self.tell(context);
                Ok(())
            }
            0x14 => self.write_control(value, context),
            0x18 => self.write_torn(value, context),
            _ => Err(Unmodelled),
        }
    }

    fn due(&self) -> Cycles {
        self.work.as_ref().map_or(NEVER, |(_, ends)| *ends)
    }

    fn act(&mut self, context: &mut Context) {
        self.settle(context);
    }
}

#[cfg(test)]
mod tests;
