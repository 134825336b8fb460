//! The image of the VESC, which has no virtual board: its start, on a processor whose chip keeps what is written
//! to its registers and is ready at once. Run with `--release`.
//!
//! The image is what this makes:
//!
//! ```text
//! cargo run --release -p siskin -- image --board vesc4-f405 --output target/images
//! ```
#![forbid(unsafe_code)]

#[path = "image/common/made.rs"]
mod made;

use std::collections::HashMap;
use std::fs;

use siskin_vboard::memory::Memory;
use siskin_vboard::processor::{BusError, Lines, Mapped, Processor, Stop, Surroundings, Width};
use siskin_vboard::time::{Cycles, NEVER};

const FLASH: u32 = 0x0800_0000;
const FLASH_BYTES: usize = 0x10_0000;
const CCM: u32 = 0x1000_0000;
const CCM_BYTES: usize = 0x1_0000;
const SRAM: u32 = 0x2000_0000;
const SRAM_BYTES: usize = 0x2_0000;

/// Registers (RM0090), and the bits that count here.
const RCC_CR: u32 = 0x4002_3800;
const SWITCHED_ON: u32 = 1 | 1 << 16 | 1 << 24;
const RCC_CFGR: u32 = 0x4002_3808;
const SELECTED: u32 = 0b11;
const RCC_APB2ENR: u32 = 0x4002_3844;
const TIM1: u32 = 1;
const RCC_CSR: u32 = 0x4002_3874;
const PWR_CSR: u32 = 0x4000_7004;
const SCALED: u32 = 1 << 14;
const FLASH_ACR: u32 = 0x4002_3c00;
const WAIT_STATES: u32 = 0b111;
const PREFETCH: u32 = 1 << 8;
const CODE_CACHE: u32 = 1 << 9;
const CONSTANTS_CACHE: u32 = 1 << 10;
const DBGMCU_IDCODE: u32 = 0xe004_2000;

/// Device 0x413: revision A, whose prefetch must stay off (ES0182), and revision 1.
const REVISION_A: u32 = 0x1000_6413;
const REVISION_1: u32 = 0x1007_6413;

/// The start takes a tenth of it.
const END: Cycles = 20_000_000;

/// Exceptions of the vector table before the interrupts, and the second DMA's streams behind them.
const EXCEPTIONS: usize = 16;
const SECOND_DMA: [usize; 8] = [56, 57, 58, 59, 60, 68, 69, 70];

/// What the linker has made of the image, from the flash's beginning on.
fn image() -> Vec<u8> {
    const BOARD: &str = "vesc4-f405";
    let path = made::made(BOARD, "bin");
    made::is_made(BOARD, &path);
    fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The chip's registers, until its program takes the PWM timer, after the clocks have been set up.
struct Registers {
    revision: u32,
    words: HashMap<u32, u32>,
    lines: Lines,
    now: Cycles,
    timer_taken: bool,
}

impl Registers {
    fn word(&self, address: u32) -> u32 {
        let word = self.words.get(&address).copied().unwrap_or(0);
        match address {
            RCC_CR | RCC_CSR => word | (word & SWITCHED_ON) << 1,
            RCC_CFGR => word | (word & SELECTED) << 2,
            PWR_CSR => word | SCALED,
            DBGMCU_IDCODE => self.revision,
            _ => word,
        }
    }
}

impl Surroundings for Registers {
    fn now(&self) -> Cycles {
        self.now
    }

    fn read(&mut self, address: u32, width: Width) -> Result<u32, BusError> {
        let word = self.word(address & !3) >> (8 * (address & 3));
        Ok(match width {
            Width::Byte => word & 0xff,
            Width::Half => word & 0xffff,
            Width::Word => word,
        })
    }

    fn write(&mut self, address: u32, width: Width, value: u32) -> Result<(), BusError> {
        // What the start sets up is written in whole words.
        if width == Width::Word {
            self.words.insert(address, value);
        }
        self.timer_taken |= address == RCC_APB2ENR && value & TIM1 != 0;
        Ok(())
    }

    fn pass(&mut self, cycles: Cycles) {
        self.now += cycles;
    }

    fn next(&self) -> Cycles {
        NEVER
    }

    fn lines(&self) -> &Lines {
        &self.lines
    }

    fn asks_to_stop(&self) -> bool {
        self.timer_taken || self.now > END
    }

    fn flash_busy_until(&self) -> Cycles {
        0
    }
}

/// Starts the image on a chip of this revision, and returns how its flash is read from then on.
fn flash_access(revision: u32) -> u32 {
    let bytes = image();
    let flash = Memory::new(FLASH, FLASH_BYTES, 0xff);
    flash.load(FLASH, &bytes);
    let mapped = |memory, writable| Mapped { memory, writable };
    let memories = [
        mapped(flash, false),
        mapped(Memory::new(CCM, CCM_BYTES, 0), true),
        mapped(Memory::new(SRAM, SRAM_BYTES, 0), true),
    ];
    let registers = Registers {
        revision,
        // The internal oscillator.
        words: HashMap::from([(RCC_CR, 1)]),
        lines: Lines::default(),
        now: 0,
        timer_taken: false,
    };
    let mut processor = Processor::new(registers, &memories);
    processor.reset(FLASH);
    assert_eq!(processor.run(), Stop::Asked);
    let registers = processor.surroundings();
    assert!(registers.timer_taken, "the start does not end");
    registers.word(FLASH_ACR)
}

#[test]
fn the_flash_is_read_ahead_and_through_its_caches() {
    let access = flash_access(REVISION_1);
    let wanted = PREFETCH | CODE_CACHE | CONSTANTS_CACHE;
    assert_eq!(access & wanted, wanted, "{access:#x}");
    // 168 MHz at 2.7 to 3.6 V (RM0090, table 10).
    assert_eq!(access & WAIT_STATES, 5, "{access:#x}");
}

#[test]
fn revision_a_does_not_read_ahead() {
    let access = flash_access(REVISION_A);
    let wanted = CODE_CACHE | CONSTANTS_CACHE;
    assert_eq!(access & (wanted | PREFETCH), wanted, "{access:#x}");
}

/// The second DMA corrupts data where it serves an AHB peripheral, as a port, beside one of APB2 (ES0182,
/// 2.1.10), and the serial line is on APB2: it has the two streams to itself.
#[test]
fn the_second_dma_serves_the_serial_line_alone() {
    let bytes = image();
    let handler = |interrupt: usize| {
        let at = 4 * (EXCEPTIONS + interrupt);
        u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"))
    };
    // What a driver does not serve has one handler, which most of the interrupts share.
    let mut shared = HashMap::new();
    for interrupt in 0..82 {
        *shared.entry(handler(interrupt)).or_insert(0) += 1;
    }
    let default = shared.iter().max_by_key(|(_, count)| **count);
    let (default, _) = default.expect("there are interrupts");
    let served = |stream: &usize| handler(SECOND_DMA[*stream]) != *default;
    let streams: Vec<usize> = (0..SECOND_DMA.len()).filter(served).collect();
    // USART6's, into the memory and out of it (RM0090, table 43).
    assert_eq!(streams, [2, 6]);
}
