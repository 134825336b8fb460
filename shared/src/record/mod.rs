//! The fault record: the last faults, and the control periods before a trip, in memory that survives a reset.
//!
//! The interrupt writes it, outside [`step`](crate::drive::step); tasks read it at any time. It consists of words, each
//! written atomically, so neither waits for the other.
//!
//! Only periods in which the bridge drives are recorded, so those before a trip remain however long the drive then
//! rests. The first trip holds them, and later faults are recorded without periods: the first is the cause more often
//! than what follows. They are held until someone has read them ([`Record::taken`]) and the motor turns again, or power
//! is lost.

mod file;

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

pub use file::{FaultSeen, PeriodSeen, Recorded};

use siskin_params::parts::Part;
use siskin_units::{AdcCounts, Duty};

use crate::drive::{Bridge, Config, Sample, State};

/// True if this program keeps a record.
pub const KEPT: bool = Part::Record.is_here();

/// Control periods kept.
pub const PERIODS: usize = 64;

/// Faults kept.
pub const FAULTS: usize = 8;

/// A mark that memory after power-up does not hold by chance, together with its inverse.
const MAGIC: u32 = 0x5369_4661;

/// Places of words. Those before [`WRITTEN`](place::WRITTEN) change only at a start and at a fault.
mod place {
    /// [`MAGIC`](super::MAGIC), followed by its inverse.
    pub(super) const MAGIC: usize = 0;
    /// Starts since power-up.
    pub(super) const STARTS: usize = 2;
    /// Faults since power-up.
    pub(super) const NOTED: usize = 3;
    /// The number, from 1, of the fault that last held the periods.
    pub(super) const HOLDER: usize = 4;
    /// Length of the held periods, s, as a float's bits.
    pub(super) const PERIOD_S: usize = 5;
    /// The ring of faults.
    pub(super) const FAULTS: usize = 6;
    /// Number of periods written, with [`HELD`](super::HELD).
    pub(super) const WRITTEN: usize = FAULTS + super::ROW * super::FAULTS;
    /// The ring of periods, which has its own array: its rows need no bounds check.
    pub(super) const PERIODS: usize = WRITTEN + 1;
}

type Row = [AtomicU32; ROW];

/// Words per fault, and per period.
const ROW: usize = 4;

/// Flag in the count of periods: a trip holds them.
const HELD: u32 = 1 << 31;

/// Marks a leg with both switches off: above any actual duty.
const NO_DUTY: u32 = u32::MAX;

/// The record.
#[derive(Debug)]
pub struct Record {
    words: [AtomicU32; place::PERIODS],
    periods: [Row; PERIODS],
    /// Number of periods written when the bridge was last off.
    rested: AtomicU32,
    /// Faults counted by the drive since this start.
    counted: AtomicU32,
    /// Nonzero from the period of a fault until its row is complete.
    begun: AtomicU32,
    /// Nonzero once someone has read the held periods.
    taken: AtomicU32,
}

impl Record {
    /// Creates an empty record, to be opened.
    pub const fn new() -> Self {
        Self {
            words: [const { AtomicU32::new(0) }; place::PERIODS],
            periods: [const { [const { AtomicU32::new(0) }; ROW] }; PERIODS],
            rested: AtomicU32::new(0),
            counted: AtomicU32::new(0),
            begun: AtomicU32::new(0),
            taken: AtomicU32::new(0),
        }
    }

    /// Opens the record at a start, before the interrupt runs: contents that survived a reset stay, random contents
    /// after power-up are cleared.
    pub fn open(&self) {
        if self.get(place::MAGIC) != MAGIC || self.get(place::MAGIC + 1) != !MAGIC {
            for word in &self.words {
                word.store(0, Relaxed);
            }
            self.put(place::MAGIC, MAGIC);
            self.put(place::MAGIC + 1, !MAGIC);
        }
        self.put(place::STARTS, self.get(place::STARTS).wrapping_add(1));
        self.counted.store(0, Relaxed);
        self.begun.store(0, Relaxed);
        self.rested.store(self.get(place::WRITTEN), Relaxed);
    }

    /// Records a period: the input of `step`, its state afterwards and its output; call it in every period.
    #[inline(always)] // in the interrupt: a driven period takes only this code
    pub fn note(&self, config: &Config, state: &State, io: (&Sample, &Bridge), period: u32) {
        let written = self.get(place::WRITTEN);
        match io.1 {
            Bridge::Duty([a, b, c]) if written & HELD == 0 => {
                let duties = [a.to_bits(), b.to_bits(), c.to_bits()];
                self.write(written, state, io.0, duties);
                self.put(place::WRITTEN, next(written));
            }
            _ => self.note_rest(config, state, io, period),
        }
    }

    /// Writes a period's row: the readings of b and a; of the supply and c; speed and angle, the upper half of each;
    /// the upper 11, 11 and 10 bits of the duties.
    // Word by word: optimised for size, a loop over them is not unrolled.
    #[inline(always)] // in each period
    fn write(&self, written: u32, state: &State, sample: &Sample, duties: [u32; 3]) {
        let [a, b, c] = sample.currents;
        let [duty_a, duty_b, duty_c] = duties;
        let (angle, speed) = state.rotor();
        let row = &self.periods[written as usize % PERIODS];
        let duties = (duty_a & 0xffe0_0000) | (duty_b >> 21 << 10) | duty_c >> 22;
        row[0].store(halves(counts(b), counts(a)), Relaxed);
        row[1].store(halves(counts(sample.bus), counts(c)), Relaxed);
        let rotor = halves(speed.to_bits() as u32, angle.to_bits() as u32);
        row[2].store(rotor, Relaxed);
        row[3].store(duties, Relaxed);
    }

    /// Records any other period.
    #[cold]
    #[inline(never)]
    fn note_rest(&self, config: &Config, state: &State, io: (&Sample, &Bridge), period: u32) {
        let (sample, bridge) = io;
        let written = self.get(place::WRITTEN);
        let free = written & HELD == 0;
        let duties = match bridge {
            Bridge::Legs(legs) => bits_of_legs(*legs),
            Bridge::Duty(_) | Bridge::Brake => [0; 3],
            Bridge::Off | Bridge::Charge(_) => [NO_DUTY; 3],
        };
        if matches!(bridge, Bridge::Off) {
            if self.begun.load(Relaxed) != 0 {
                self.complete_fault(config, state, sample, period);
            } else if self.counted.load(Relaxed) != state.last_fault().count {
                self.begin_fault(state);
                if free && written != self.rested.load(Relaxed) {
                    // The period of a trip is long: the rest of the fault's row waits for the next one.
                    self.put(place::PERIOD_S, config.scale.period_s.to_bits());
                    self.put(place::HOLDER, self.get(place::NOTED) + 1);
                    self.taken.store(0, Relaxed);
                    self.write(written, state, sample, duties);
                    let held = next(written) | HELD;
                    self.put(place::WRITTEN, held);
                    self.rested.store(held, Relaxed);
                    return;
                }
                self.complete_fault(config, state, sample, period);
            }
            self.rested.store(written, Relaxed);
        } else if free {
            self.write(written, state, sample, duties);
            self.put(place::WRITTEN, next(written));
        } else if self.taken.load(Relaxed) != 0 && state.drives() {
            // A tune at the next start, or a held shaft, overwrites nothing.
            self.taken.store(0, Relaxed);
            self.put(place::WRITTEN, 0);
        }
    }

    /// Records which fault is the last, and in which phase: another may follow in the next period.
    fn begin_fault(&self, state: &State) {
        let last = state.last_fault();
        self.counted.store(last.count, Relaxed);
        let what = last.fault as u32 | (last.phase as u32) << 8;
        self.put(self.fault_row(), what | self.get(place::STARTS) << 16);
        self.begun.store(1, Relaxed);
    }

    /// Records when it was, and what the supply and the rotor did.
    fn complete_fault(&self, config: &Config, state: &State, sample: &Sample, period: u32) {
        let at = self.fault_row();
        let (_, speed) = state.rotor();
        let speed = speed.to_bits() as u32;
        self.put(at + 1, period);
        self.put(at + 2, halves(speed, counts(sample.bus)));
        self.put(at + 3, config.scale.period_s.to_bits());
        self.put(place::NOTED, self.get(place::NOTED) + 1);
        self.begun.store(0, Relaxed);
    }

    /// Returns where the next fault's row is.
    fn fault_row(&self) -> usize {
        place::FAULTS + ROW * (self.get(place::NOTED) as usize % FAULTS)
    }

    /// Notes that someone has read the held periods: the next driven ones may replace them.
    pub fn taken(&self) {
        self.taken.store(1, Relaxed);
    }

    #[inline(always)] // in each period
    fn get(&self, place: usize) -> u32 {
        self.words[place].load(Relaxed)
    }

    #[inline(always)] // in each period
    fn put(&self, place: usize, word: u32) {
        self.words[place].store(word, Relaxed);
    }
}

impl Default for Record {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns the next count. After 2^31 periods, a day of them, it restarts, and so do the rows.
#[inline(always)] // in each period
fn next(written: u32) -> u32 {
    (written + 1) & !HELD
}

fn bits_of_legs([a, b, c]: [Option<Duty>; 3]) -> [u32; 3] {
    let bits = |duty: Option<Duty>| duty.map_or(NO_DUTY, Duty::to_bits);
    [bits(a), bits(b), bits(c)]
}

/// Packs the upper halves of both: one instruction.
#[inline(always)] // in each period
fn halves(upper: u32, lower: u32) -> u32 {
    (upper & 0xffff_0000) | lower >> 16
}

/// Returns a reading's bits; whole counts are in the upper half.
#[inline(always)] // in each period
fn counts(reading: AdcCounts) -> u32 {
    reading.to_bits() as u32
}

#[cfg(test)]
mod tests;
