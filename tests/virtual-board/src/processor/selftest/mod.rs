//! What the processor must do according to the architecture (ARMv7-M, DDI 0403): programs, and what they
//! report.
//!
//! A program runs from flash on a bed with a few registers, through which it leaves marks, raises and lowers
//! interrupt lines, and stops. What is pending may be taken as late as the next branch, so there is one where
//! that matters. Where the engine is known to deviate, the test says so as long as it does.

mod assembler;
mod controller;
mod entry;
mod faults;
mod floats;
mod masks;
mod order;
mod sleep;
mod state;
mod timers;

use super::{BusError, HandlerEvent, Lines, Mapped, Processor, Stop, Surroundings, Width};
use crate::memory::Memory;
use crate::time::{Cycles, NEVER};
use assembler::{Code, assemble};

/// Where the program lies, after its vector table.
const FLASH: u32 = 0x0800_0000;
/// Its working memory.
const RAM: u32 = 0x2000_0000;
/// Bytes of each.
const BYTES: usize = 0x1000;
/// Where the main stack begins.
const STACK: u32 = RAM + BYTES as u32;
/// Entries in the vector table: the system's and 32 interrupts.
const VECTORS: usize = 48;

/// The bed's registers: a mark, a stop, lines to raise and to lower with one bit per interrupt, a line by its
/// number to raise after [`LATER`], the non-maskable line, flash to be busy for [`LATER`].
const BED: u32 = 0x4000_0000;
const MARK: u32 = BED;
const STOP: u32 = BED + 4;
const RAISE: u32 = BED + 8;
const LOWER: u32 = BED + 12;
const RAISE_LATER: u32 = BED + 16;
const NON_MASKABLE: u32 = BED + 20;
const BUSY: u32 = BED + 24;
/// A register that the bed does not model.
const UNKNOWN: u32 = BED + 0x100;

/// Cycles after which a delayed line rises, and for which flash is busy.
const LATER: Cycles = 5_000;
/// Cycles after which a program that does not end is stopped.
const END: Cycles = 1_000_000;

/// What each program begins with, and what ends one that took an exception without a handler: a mark of the
/// exception's number from 0xba00 on.
const FRAME: &str = "
    start: mov32 r10, 0x40000000
    b main
    unexpected: mrs r0, ipsr
    mov r1, #0xba00
    orrs r0, r1
    str r0, [r10]
    stop: str r0, [r10, #4]
    halt: b halt
";

/// The bed that a program runs on.
pub(super) struct Bed {
    now: Cycles,
    lines: Lines,
    /// When lines rise by themselves.
    later: Vec<(Cycles, u16)>,
    stopped: bool,
    /// What the program has reported.
    marks: Vec<u32>,
    /// Exceptions that were entered and left.
    exceptions: Vec<(u16, bool)>,
    flash_busy_until: Cycles,
}

impl Surroundings for Bed {
    fn now(&self) -> Cycles {
        self.now
    }

    fn read(&mut self, address: u32, _: Width) -> Result<u32, BusError> {
        match address {
            BED..UNKNOWN => Ok(0),
            UNKNOWN => Err(BusError::Unmodelled),
            _ => Err(BusError::Nothing),
        }
    }

    fn write(&mut self, address: u32, _: Width, value: u32) -> Result<(), BusError> {
        match address {
            MARK => self.marks.push(value),
            STOP => self.stopped = true,
            RAISE => self.lines.interrupts |= u128::from(value),
            LOWER => self.lines.interrupts &= !u128::from(value),
            RAISE_LATER => self.later.push((self.now + LATER, value as u16)),
            BUSY => self.flash_busy_until = self.now + LATER,
            NON_MASKABLE => self.lines.non_maskable = value != 0,
            UNKNOWN => return Err(BusError::Unmodelled),
            _ => return Err(BusError::Nothing),
        }
        Ok(())
    }

    fn pass(&mut self, cycles: Cycles) {
        self.now += cycles;
        let now = self.now;
        let lines = &mut self.lines;
        self.later.retain(|(at, line)| {
            if *at <= now {
                lines.interrupts |= 1 << line;
            }
            *at > now
        });
        self.stopped |= now >= END;
    }

    fn next(&self) -> Cycles {
        let rises = self.later.iter().map(|(at, _)| *at);
        rises.chain([END]).min().unwrap_or(NEVER)
    }

    fn lines(&self) -> &Lines {
        &self.lines
    }

    fn asks_to_stop(&self) -> bool {
        self.stopped
    }

    fn flash_busy_until(&self) -> Cycles {
        self.flash_busy_until
    }

    fn exception(&mut self, passage: &HandlerEvent) {
        self.exceptions.push((passage.exception, passage.entered));
    }
}

/// A program that has been run.
struct Ran {
    processor: Processor<Bed>,
    stop: Stop,
    code: Code,
    ram: Memory,
}

/// Runs a program from its label `main`. A handler's label is `exception_` and its number.
fn run(program: &str) -> Ran {
    let mut ran = load(program);
    ran.stop = ran.processor.run();
    ran
}

/// Loads a program that is to be run.
fn load(program: &str) -> Ran {
    let origin = FLASH + 4 * VECTORS as u32;
    let code = assemble(&format!("{FRAME}\n{program}"), origin);
    let flash = Memory::new(FLASH, BYTES, 0xff);
    let ram = Memory::new(RAM, BYTES, 0);
    flash.load(origin, &code.bytes);
    flash.write(FLASH, 4, STACK);
    for number in 1..VECTORS {
        let handler = match number {
            1 => "start".to_string(),
            _ => format!("exception_{number}"),
        };
        let handler = code
            .labels
            .get(&handler)
            .unwrap_or(&code.labels["unexpected"]);
        flash.write(FLASH + 4 * number as u32, 4, handler | 1);
    }
    let bed = Bed {
        now: 0,
        lines: Lines::default(),
        later: Vec::new(),
        stopped: false,
        marks: Vec::new(),
        exceptions: Vec::new(),
        flash_busy_until: 0,
    };
    let mapped = |memory: &Memory, writable| Mapped {
        memory: memory.clone(),
        writable,
    };
    let mut processor = Processor::new(bed, &[mapped(&flash, false), mapped(&ram, true)]);
    processor.reset(FLASH);
    Ran {
        processor,
        stop: Stop::Asked,
        code,
        ram,
    }
}

/// Runs a program that stops by itself, and returns its marks.
fn marks(program: &str) -> Vec<u32> {
    let mut ran = run(program);
    let bed = ran.processor.surroundings();
    assert_eq!(ran.stop, Stop::Asked, "marks: {:x?}", bed.marks);
    assert!(bed.now < END, "does not end; marks: {:x?}", bed.marks);
    bed.marks.clone()
}
