//! The image of the VESC, which has no virtual board: its start and its control interrupt, on a processor whose
//! chip keeps what is written to its registers and is always ready. Run with `--release`.
//!
//! The image is what this makes:
//!
//! ```text
//! cargo run --release -p siskin -- image --board vesc4-f405-r001 --output target/images
//! ```
#![forbid(unsafe_code)]

#[path = "image/common/made.rs"]
mod made;

use std::collections::HashMap;
use std::fs;
use std::ops::Range;

use siskin_vboard::memory::Memory;
use siskin_vboard::processor::{
    BusError, HandlerEvent, Lines, Mapped, Processor, Stop, Surroundings, Width,
};
use siskin_vboard::time::Cycles;

const FLASH: u32 = 0x0800_0000;
const FLASH_BYTES: usize = 0x10_0000;
const CCM: u32 = 0x1000_0000;
const CCM_BYTES: usize = 0x1_0000;
const SRAM: u32 = 0x2000_0000;
const SRAM_BYTES: usize = 0x2_0000;

/// Registers (RM0090), and the bits that matter here.
const RCC_CR: u32 = 0x4002_3800;
const CRYSTAL_ON: u32 = 1 << 16;
const CRYSTAL_WATCHED: u32 = 1 << 19;
const SWITCHED_ON: u32 = 1 | CRYSTAL_ON | 1 << 24;
const RCC_PLLCFGR: u32 = 0x4002_3804;
const RCC_CFGR: u32 = 0x4002_3808;
const SELECTED: u32 = 0b11;
const RCC_APB2ENR: u32 = 0x4002_3844;
const TIM1: u32 = 1;
const TIM1_CR1: u32 = 0x4001_0000;
const DOWN: u32 = 1 << 4;
const TIM1_SR: u32 = 0x4001_0010;
const UPDATED: u32 = 1;
const TIM1_BDTR: u32 = 0x4001_0044;
const OUTPUTS_ON: u32 = 1 << 15;
const RCC_CSR: u32 = 0x4002_3874;
const PWR_CSR: u32 = 0x4000_7004;
const SCALED: u32 = 1 << 14;
const FLASH_ACR: u32 = 0x4002_3c00;
const WAIT_STATES: u32 = 0b111;
const PREFETCH: u32 = 1 << 8;
const CODE_CACHE: u32 = 1 << 9;
const CONSTANTS_CACHE: u32 = 1 << 10;
const DBGMCU_IDCODE: u32 = 0xe004_2000;

/// The time driver's timer counts microseconds.
const TIM4_CNT: u32 = 0x4000_0824;
const CYCLES_A_US: Cycles = 168;
const ADC1_SR: u32 = 0x4001_2000;
const USART6_SR: u32 = 0x4001_1400;
const SENT: u32 = 0b11 << 6;
const USART6_DR: u32 = 0x4001_1404;
/// The ports' pulls.
const GPIOB_PUPDR: u32 = 0x4002_040c;
const GPIOC_PUPDR: u32 = 0x4002_080c;
const GPIOB_IDR: u32 = 0x4002_0410;
/// The gate driver's nFAULT is PC12, and its enable PC10.
const GPIOC_IDR: u32 = 0x4002_0810;
const GPIOC_BSRR: u32 = 0x4002_0818;
const FAULT: u32 = 1 << 12;
const ENABLE: u32 = 1 << 10;
const DISABLE: u32 = ENABLE << 16;
const EXTI_IMR: u32 = 0x4001_3c00;

/// Device 0x413: revision A, whose prefetch must stay off (ES0182), and revision 1.
const REVISION_A: u32 = 0x1000_6413;
const REVISION_1: u32 = 0x1007_6413;

/// The control interrupt comes within half of it.
const END: Cycles = 40_000_000;

/// The end-of-conversion interrupt of the injected sequence, and how often it comes: 24 kHz.
const CONVERTED: u16 = 18;
const PERIOD: Cycles = 7_000;

/// Exceptions in the vector table before the interrupts, and the second DMA's streams after them.
const EXCEPTIONS: usize = 16;
const SECOND_DMA: [usize; 8] = [56, 57, 58, 59, 60, 68, 69, 70];

/// Returns the linked image, from the start of the flash.
fn image() -> Vec<u8> {
    const BOARD: &str = "vesc4-f405-r001";
    let path = made::made(BOARD, "bin");
    made::is_made(BOARD, &path);
    fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The gate driver's alarm and its enable, as set up by the program.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Driver {
    heard: bool,
    enabled: bool,
}

/// The crystal's defects.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Crystal {
    Sound,
    /// It does not start.
    Dead,
    /// It stops in this control period.
    Stops(usize),
}

/// The chip's registers.
#[derive(Clone)]
struct Registers {
    revision: u32,
    crystal: Crystal,
    words: HashMap<u32, u32>,
    lines: Lines,
    now: Cycles,
    /// When the converters are next done.
    converted: Cycles,
    /// The gate driver at the start of each control period.
    periods: Vec<Driver>,
    /// The control periods in which the gate driver's alarm is low.
    alarm: Range<usize>,
    driver_enabled: bool,
    /// How often port B, with two Hall sensors, was read.
    hall_reads: usize,
    outputs_were_on: bool,
    /// What the serial line has sent.
    sent: Vec<u8>,
    /// When the run ends.
    ends: fn(&Self) -> bool,
}

impl Registers {
    fn word(&self, address: u32) -> u32 {
        let word = self.words.get(&address).copied().unwrap_or(0);
        match address {
            RCC_CR if self.crystal == Crystal::Dead => {
                word | (word & SWITCHED_ON & !CRYSTAL_ON) << 1
            }
            RCC_CR | RCC_CSR => word | (word & SWITCHED_ON) << 1,
            RCC_CFGR => word | (word & SELECTED) << 2,
            PWR_CSR => word | SCALED,
            DBGMCU_IDCODE => self.revision,
            TIM4_CNT => (self.now / CYCLES_A_US) as u32 & 0xffff,
            // It is counting down when the control begins.
            TIM1_CR1 => word | DOWN,
            TIM1_SR => word | UPDATED,
            USART6_SR => SENT,
            GPIOC_IDR => {
                if self.alarms() {
                    0
                } else {
                    FAULT
                }
            }
            _ => word,
        }
    }

    /// Returns whether the gate driver's alarm is low in this period.
    fn alarms(&self) -> bool {
        let period = self.periods.len().checked_sub(1);
        period.is_some_and(|period| self.alarm.contains(&period))
    }

    /// Returns whether the program has set up the PWM timer, which it does after the clocks.
    fn timer_taken(&self) -> bool {
        self.word(RCC_APB2ENR) & TIM1 != 0
    }
}

impl Surroundings for Registers {
    fn now(&self) -> Cycles {
        self.now
    }

    fn read(&mut self, address: u32, width: Width) -> Result<u32, BusError> {
        self.hall_reads += usize::from(address == GPIOB_IDR);
        let word = self.word(address & !3) >> (8 * (address & 3));
        Ok(match width {
            Width::Byte => word & 0xff,
            Width::Half => word & 0xffff,
            Width::Word => word,
        })
    }

    fn write(&mut self, address: u32, width: Width, value: u32) -> Result<(), BusError> {
        // Set-up writes are whole words.
        if width == Width::Word {
            self.words.insert(address, value);
        }
        match address {
            // The control clears the request.
            ADC1_SR => self.lines.set(CONVERTED, false),
            GPIOC_BSRR if value & ENABLE != 0 => self.driver_enabled = true,
            GPIOC_BSRR if value & DISABLE != 0 => self.driver_enabled = false,
            TIM1_BDTR => self.outputs_were_on |= value & OUTPUTS_ON != 0,
            USART6_DR => self.sent.push(value as u8),
            _ => {}
        }
        Ok(())
    }

    fn pass(&mut self, cycles: Cycles) {
        self.now += cycles;
        if self.now >= self.converted {
            self.converted += PERIOD;
            self.lines.set(CONVERTED, true);
        }
    }

    fn next(&self) -> Cycles {
        self.converted
    }

    fn lines(&self) -> &Lines {
        &self.lines
    }

    fn asks_to_stop(&self) -> bool {
        (self.ends)(self) || self.now > END
    }

    fn flash_busy_until(&self) -> Cycles {
        0
    }

    fn exception(&mut self, passage: &HandlerEvent) {
        if passage.entered && usize::from(passage.exception) == EXCEPTIONS + usize::from(CONVERTED)
        {
            self.periods.push(Driver {
                heard: self.word(EXTI_IMR) & FAULT != 0,
                enabled: self.driver_enabled,
            });
            let stops = self.crystal == Crystal::Stops(self.periods.len());
            if stops && self.word(RCC_CR) & CRYSTAL_WATCHED != 0 {
                self.lines.non_maskable = true;
            }
        }
    }
}

/// Runs these bytes of an image on a chip of this revision.
fn run(
    bytes: &[u8],
    revision: u32,
    alarm: Range<usize>,
    ends: fn(&Registers) -> bool,
) -> Registers {
    let (registers, stop) = run_with(Crystal::Sound, bytes, revision, alarm, ends);
    assert_eq!(stop, Stop::Asked);
    registers
}

/// Likewise with this crystal; also returns why it stopped.
fn run_with(
    crystal: Crystal,
    bytes: &[u8],
    revision: u32,
    alarm: Range<usize>,
    ends: fn(&Registers) -> bool,
) -> (Registers, Stop) {
    let flash = Memory::new(FLASH, FLASH_BYTES, 0xff);
    flash.load(FLASH, bytes);
    let mapped = |memory, writable| Mapped { memory, writable };
    let memories = [
        mapped(flash, false),
        mapped(Memory::new(CCM, CCM_BYTES, 0), true),
        mapped(Memory::new(SRAM, SRAM_BYTES, 0), true),
    ];
    let registers = Registers {
        revision,
        crystal,
        // The internal oscillator.
        words: HashMap::from([(RCC_CR, 1)]),
        lines: Lines::default(),
        now: 0,
        converted: PERIOD,
        periods: Vec::new(),
        alarm,
        driver_enabled: false,
        hall_reads: 0,
        outputs_were_on: false,
        sent: Vec::new(),
        ends,
    };
    let mut processor = Processor::new(registers, &memories);
    processor.reset(FLASH);
    let stop = processor.run();
    (processor.surroundings().clone(), stop)
}

/// Starts the image on a chip of this revision, and returns how its flash is read from then on.
fn flash_access(revision: u32) -> u32 {
    let registers = run(&image(), revision, 0..0, Registers::timer_taken);
    assert!(registers.timer_taken(), "the start does not end");
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

/// Returns the two bits of a pin's pull: 1 is up.
fn pull(word: u32, pin: u32) -> u32 {
    word >> (2 * pin) & 0b11
}

#[test]
fn inputs_rest_high_with_nothing_plugged_in() {
    let periods = |registers: &Registers| registers.periods.len() > 10;
    let registers = run(&image(), REVISION_1, 0..0, periods);
    let (port_b, port_c) = (registers.word(GPIOB_PUPDR), registers.word(GPIOC_PUPDR));
    // The serial line's, and Hall sensor 3's.
    assert_eq!([7, 11].map(|pin| pull(port_c, pin)), [1; 2]);
    // Hall sensors 1 and 2.
    assert_eq!([6, 7].map(|pin| pull(port_b, pin)), [1; 2]);
    // In each period.
    assert!(registers.hall_reads >= registers.periods.len() - 1);
}

/// Returns the PLL's source, which is the crystal if true, and its frequency in MHz with that source (RM0090,
/// RCC_PLLCFGR).
fn pll(word: u32) -> (bool, u32) {
    let from_crystal = word >> 22 & 1 != 0;
    let source_mhz = if from_crystal { 8 } else { 16 };
    let (divider, factor) = (word & 0x3f, word >> 6 & 0x1ff);
    let output = 2 * ((word >> 16 & 0b11) + 1);
    (from_crystal, source_mhz * factor / divider / output)
}

/// The crystal gives the clock. One that does not start within 0.1 s is left out, and everything else is as with it.
#[test]
fn a_crystal_that_does_not_start_is_replaced() {
    for (crystal, has_crystal) in [(Crystal::Sound, true), (Crystal::Dead, false)] {
        let periods = |registers: &Registers| registers.periods.len() > 10;
        let (registers, stop) = run_with(crystal, &image(), REVISION_1, 0..0, periods);
        assert!(registers.periods.len() > 10, "{crystal:?}: {stop:?}");
        assert_eq!(pll(registers.word(RCC_PLLCFGR)), (has_crystal, 168));
        let control = registers.word(RCC_CR);
        let used = control & (CRYSTAL_ON | CRYSTAL_WATCHED);
        let wanted = if has_crystal {
            CRYSTAL_ON | CRYSTAL_WATCHED
        } else {
            0
        };
        assert_eq!(used, wanted, "{crystal:?}: {control:#x}");
    }
}

/// Without it the chip runs ten times as slowly, and so does the PWM: the bridge must not go on.
#[test]
fn a_crystal_that_stops_turns_the_bridge_off_and_restarts() {
    let crystal = Crystal::Stops(100);
    let periods = |registers: &Registers| registers.periods.len() > 110;
    let (registers, stop) = run_with(crystal, &image(), REVISION_1, 0..0, periods);
    assert_eq!((registers.periods.len(), stop), (100, Stop::Reset));
    assert_eq!(registers.word(TIM1_BDTR) & OUTPUTS_ON, 0);
}

/// The second DMA corrupts data if it serves an AHB peripheral, such as a port, as well as one on APB2 (ES0182,
/// 2.1.10), and the serial line is on APB2: it has the two streams to itself.
#[test]
fn the_second_dma_serves_the_serial_line_alone() {
    let bytes = image();
    let handler = |interrupt: usize| {
        let at = 4 * (EXCEPTIONS + interrupt);
        u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"))
    };
    // Interrupts that no driver serves share one handler, which most have.
    let mut shared = HashMap::new();
    for interrupt in 0..82 {
        *shared.entry(handler(interrupt)).or_insert(0) += 1;
    }
    let default = shared.iter().max_by_key(|(_, count)| **count);
    let (default, _) = default.expect("there are interrupts");
    let served = |stream: &usize| handler(SECOND_DMA[*stream]) != *default;
    let streams: Vec<usize> = (0..SECOND_DMA.len()).filter(served).collect();
    // USART6's, into memory and out of it (RM0090, table 43).
    assert_eq!(streams, [2, 6]);
}

/// Control periods for which the gate driver rests after an alarm, and after which it is enabled again
/// (`firmware/src/interrupt/rest.rs`).
const REST: usize = 640;
const ASLEEP: usize = 20;

/// A driver that sleeps or comes up pulls nFAULT low: its alarm is masked until the rest is over, so that this
/// edge requests no new rest.
#[test]
fn the_gate_drivers_alarm_is_masked_while_it_rests() {
    const ALARM: usize = 100;
    let ends = |registers: &Registers| registers.periods.len() > ALARM + REST + 50;
    // It stays low until shortly before the driver is up.
    let alarm = ALARM..ALARM + REST - 10;
    let periods = run(&image(), REVISION_1, alarm, ends).periods;
    assert!(
        periods.len() > ALARM + REST + 50,
        "{} periods",
        periods.len()
    );
    for (period, driver) in periods.into_iter().enumerate() {
        let rested = period.checked_sub(ALARM + 1);
        let wanted = Driver {
            heard: rested.is_none_or(|rested| rested >= REST),
            enabled: rested.is_none_or(|rested| rested >= ASLEEP),
        };
        assert_eq!(driver, wanted, "period {period}");
    }
}

/// A wrong bit in the vectors, in the middle of the program or in its last byte: the image reports it, and
/// neither the PWM nor the gate driver turns on.
#[test]
fn a_damaged_image_goes_no_further_than_to_say_so() {
    let told = |registers: &Registers| registers.sent.len() >= 62;
    let sound = image();
    for at in [0x1d4, sound.len() / 2, sound.len() - 1] {
        let mut bytes = sound.clone();
        bytes[at] ^= 1 << 4;
        let registers = run(&bytes, REVISION_1, 0..0, told);
        let text = b"Image damaged: flash it anew";
        let says = registers
            .sent
            .windows(text.len())
            .any(|piece| piece == text);
        assert!(says, "{at:#x}: {:02x?}", registers.sent);
        assert!(registers.periods.is_empty());
        assert!(!registers.outputs_were_on && !registers.driver_enabled);
    }
    // A sound one runs the PWM and says nothing about it.
    let registers = run(&sound, REVISION_1, 0..0, |registers| {
        registers.periods.len() > 10
    });
    assert!(registers.periods.len() > 10 && registers.driver_enabled);
    assert!(registers.sent.is_empty(), "{:02x?}", registers.sent);
}
