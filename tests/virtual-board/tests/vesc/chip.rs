//! The VESC's chip, as far as its image must have it: what is written to its registers stays, and it is always ready.

use std::collections::HashMap;
use std::ops::Range;

use siskin_vboard::memory::Memory;
use siskin_vboard::processor::{
    BusError, HandlerEvent, Lines, Mapped, Processor, Stop, Surroundings, Width,
};
use siskin_vboard::time::Cycles;

pub(crate) const FLASH: u32 = 0x0800_0000;
pub(crate) const FLASH_BYTES: usize = 0x10_0000;
pub(crate) const CCM: u32 = 0x1000_0000;
pub(crate) const CCM_BYTES: usize = 0x1_0000;
pub(crate) const SRAM: u32 = 0x2000_0000;
pub(crate) const SRAM_BYTES: usize = 0x2_0000;

/// Registers (RM0090), and the bits that matter here.
pub(crate) const RCC_CR: u32 = 0x4002_3800;
pub(crate) const CRYSTAL_ON: u32 = 1 << 16;
pub(crate) const CRYSTAL_WATCHED: u32 = 1 << 19;
pub(crate) const SWITCHED_ON: u32 = 1 | CRYSTAL_ON | 1 << 24;
pub(crate) const RCC_PLLCFGR: u32 = 0x4002_3804;
pub(crate) const RCC_CFGR: u32 = 0x4002_3808;
pub(crate) const SELECTED: u32 = 0b11;
pub(crate) const RCC_APB2ENR: u32 = 0x4002_3844;
pub(crate) const TIM1: u32 = 1;
pub(crate) const TIM1_CR1: u32 = 0x4001_0000;
pub(crate) const DOWN: u32 = 1 << 4;
pub(crate) const TIM1_SR: u32 = 0x4001_0010;
pub(crate) const UPDATED: u32 = 1;
pub(crate) const TIM1_BDTR: u32 = 0x4001_0044;
pub(crate) const OUTPUTS_ON: u32 = 1 << 15;
pub(crate) const RCC_CSR: u32 = 0x4002_3874;
pub(crate) const PWR_CR: u32 = 0x4000_7000;
pub(crate) const DETECTOR_ON: u32 = 1 << 4;
pub(crate) const PWR_CSR: u32 = 0x4000_7004;
pub(crate) const SUPPLY_LOW: u32 = 1 << 2;
pub(crate) const SCALED: u32 = 1 << 14;
pub(crate) const FLASH_ACR: u32 = 0x4002_3c00;
pub(crate) const WAIT_STATES: u32 = 0b111;
pub(crate) const PREFETCH: u32 = 1 << 8;
pub(crate) const CODE_CACHE: u32 = 1 << 9;
pub(crate) const CONSTANTS_CACHE: u32 = 1 << 10;
pub(crate) const DBGMCU_IDCODE: u32 = 0xe004_2000;

/// The time driver's timer counts microseconds. Where tasks are to run, it is due each millisecond: its alarm and,
/// as often as half of its range has passed, the flag of that half.
pub(crate) const TIM4_CNT: u32 = 0x4000_0824;
pub(crate) const TIM4_SR: u32 = 0x4000_0810;
pub(crate) const DUE: u32 = 1 << 2;
pub(crate) const HALVES: [u32; 2] = [1, 1 << 1];
pub(crate) const HALF: u64 = 1 << 15;
pub(crate) const TIM4: u16 = 30;
pub(crate) const CYCLES_A_US: Cycles = 168;
pub(crate) const ADC1_SR: u32 = 0x4001_2000;
pub(crate) const ADC3_SR: u32 = 0x4001_2200;
pub(crate) const THERMISTOR_READ: u32 = 1 << 4 | 1 << 1;
pub(crate) const USART6_SR: u32 = 0x4001_1400;
pub(crate) const SENT: u32 = 0b11 << 6;
pub(crate) const USART6_DR: u32 = 0x4001_1404;
/// The ports' pulls.
pub(crate) const GPIOB_PUPDR: u32 = 0x4002_040c;
pub(crate) const GPIOC_PUPDR: u32 = 0x4002_080c;
pub(crate) const GPIOB_IDR: u32 = 0x4002_0410;
/// The stream that receives for it: what is left of the buffer, and where it is.
pub(crate) const RECEIVED_LEFT: u32 = 0x4002_6444;
pub(crate) const RECEIVED_TO: u32 = 0x4002_644c;
/// The gate driver's nFAULT is PC12, and its enable PC10.
pub(crate) const GPIOC_IDR: u32 = 0x4002_0810;
pub(crate) const GPIOC_BSRR: u32 = 0x4002_0818;
pub(crate) const FAULT: u32 = 1 << 12;
pub(crate) const ENABLE: u32 = 1 << 10;
pub(crate) const DISABLE: u32 = ENABLE << 16;
pub(crate) const EXTI_IMR: u32 = 0x4001_3c00;

/// Device 0x413: revision A, whose prefetch must stay off (ES0182), and revision 1.
pub(crate) const REVISION_A: u32 = 0x1000_6413;
pub(crate) const REVISION_1: u32 = 0x1007_6413;

/// The control interrupt comes within half of it.
pub(crate) const END: Cycles = 40_000_000;

/// The end-of-conversion interrupt of the injected sequence, and how often it comes: 24 kHz.
pub(crate) const CONVERTED: u16 = 18;
pub(crate) const PERIOD: Cycles = 7_000;

/// The control period in which it hears something.
pub(crate) const HEARD: usize = 100;

/// Exceptions in the vector table before the interrupts.
pub(crate) const EXCEPTIONS: usize = 16;

/// The gate driver's alarm and its enable, as set up by the program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Driver {
    pub(crate) heard: bool,
    pub(crate) enabled: bool,
}

/// The crystal's defects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Crystal {
    Sound,
    /// It does not start.
    Dead,
    /// It stops in this control period.
    Stops(usize),
}

/// The chip's registers.
#[derive(Clone)]
pub(crate) struct Registers {
    pub(crate) revision: u32,
    pub(crate) crystal: Crystal,
    pub(crate) words: HashMap<u32, u32>,
    pub(crate) lines: Lines,
    pub(crate) flash: Memory,
    pub(crate) memory: Memory,
    pub(crate) supply_is_low: bool,
    /// What the serial line receives in control period [`HEARD`], and has received.
    pub(crate) said: Vec<u8>,
    pub(crate) received: u32,
    /// The time driver's timer: its flags, and the halves of its range that have passed.
    pub(crate) due: u32,
    pub(crate) halves: u64,
    pub(crate) now: Cycles,
    /// When the converters are next done.
    pub(crate) converted: Cycles,
    /// The gate driver at the start of each control period.
    pub(crate) periods: Vec<Driver>,
    /// The control periods in which the gate driver's alarm is low.
    pub(crate) alarm: Range<usize>,
    pub(crate) driver_enabled: bool,
    /// How often port B, with two Hall sensors, was read.
    pub(crate) hall_reads: usize,
    pub(crate) outputs_were_on: bool,
    /// What the serial line has sent.
    pub(crate) sent: Vec<u8>,
    /// When the run ends.
    pub(crate) ends: fn(&Self) -> bool,
}

impl Registers {
    pub(crate) fn word(&self, address: u32) -> u32 {
        let word = self.words.get(&address).copied().unwrap_or(0);
        match address {
            RCC_CR if self.crystal == Crystal::Dead => {
                word | (word & SWITCHED_ON & !CRYSTAL_ON) << 1
            }
            RCC_CR | RCC_CSR => word | (word & SWITCHED_ON) << 1,
            RCC_CFGR => word | (word & SELECTED) << 2,
            PWR_CSR => word | SCALED | self.supply(),
            RECEIVED_LEFT => word - self.received,
            DBGMCU_IDCODE => self.revision,
            TIM4_SR => self.due,
            ADC3_SR => THERMISTOR_READ,
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

    /// Wakes the tasks.
    fn wake(&mut self) {
        self.due |= DUE;
        if self.now / CYCLES_A_US / HALF > self.halves {
            self.halves += 1;
            self.due |= HALVES[(self.halves % 2) as usize];
        }
        self.lines.set(TIM4, true);
    }

    /// Returns the supply detector's output.
    fn supply(&self) -> u32 {
        let detects = self.word(PWR_CR) & DETECTOR_ON != 0;
        if detects && self.supply_is_low {
            SUPPLY_LOW
        } else {
            0
        }
    }

    /// Returns whether the program has set up the PWM timer, which it does after the clocks.
    pub(crate) fn timer_taken(&self) -> bool {
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
            TIM4_SR => {
                self.due = 0;
                self.lines.set(TIM4, false);
            }
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
            if !self.said.is_empty() && (self.converted / PERIOD).is_multiple_of(24) {
                self.wake();
            }
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
            if self.periods.len() == HEARD {
                self.memory.load(self.word(RECEIVED_TO), &self.said);
                self.received = self.said.len() as u32;
            }
            let stops = self.crystal == Crystal::Stops(self.periods.len());
            if stops && self.word(RCC_CR) & CRYSTAL_WATCHED != 0 {
                self.lines.non_maskable = true;
            }
        }
    }
}

impl Registers {
    /// Returns those of a chip of this revision on a sound board.
    pub(crate) fn of(revision: u32, ends: fn(&Self) -> bool) -> Self {
        Self {
            revision,
            crystal: Crystal::Sound,
            // The internal oscillator.
            words: HashMap::from([(RCC_CR, 1)]),
            lines: Lines::default(),
            flash: Memory::new(FLASH, FLASH_BYTES, 0xff),
            memory: Memory::new(SRAM, SRAM_BYTES, 0),
            supply_is_low: false,
            said: Vec::new(),
            received: 0,
            due: 0,
            halves: 0,
            now: 0,
            converted: PERIOD,
            periods: Vec::new(),
            alarm: 0..0,
            driver_enabled: false,
            hall_reads: 0,
            outputs_were_on: false,
            sent: Vec::new(),
            ends,
        }
    }

    /// Runs these bytes of an image.
    pub(crate) fn run(self, bytes: &[u8]) -> (Self, Stop) {
        self.flash.load(FLASH, bytes);
        let mapped = |memory, writable| Mapped { memory, writable };
        let memories = [
            // Whoever is asked to store may write it, its controller not being modelled.
            mapped(self.flash.clone(), !self.said.is_empty()),
            mapped(Memory::new(CCM, CCM_BYTES, 0), true),
            mapped(self.memory.clone(), true),
        ];
        let mut processor = Processor::new(self, &memories);
        processor.reset(FLASH);
        let stop = processor.run();
        (processor.surroundings().clone(), stop)
    }
}
