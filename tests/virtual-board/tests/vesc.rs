//! The image of the VESC, which has no virtual board: its start and its control interrupt, on a processor whose
//! chip keeps what is written to its registers and is always ready. Run with `--release`.
//!
//! The image is what this makes:
//!
//! ```text
//! cargo run --release -p siskin -- image --board vesc4-f405-r001 --output target/images
//! ```
#![forbid(unsafe_code)]

#[path = "vesc/chip.rs"]
mod chip;
#[path = "image/common/made.rs"]
mod made;
#[path = "vesc/store.rs"]
mod store;

use std::collections::HashMap;
use std::fs;
use std::ops::Range;

use chip::*;
use siskin_vboard::processor::Stop;

/// The second DMA's streams among the interrupts.
const SECOND_DMA: [usize; 8] = [56, 57, 58, 59, 60, 68, 69, 70];

/// Returns the linked image, from the start of the flash.
fn image() -> Vec<u8> {
    const BOARD: &str = "vesc4-f405-r001";
    let path = made::made(BOARD, "bin");
    made::is_made(BOARD, &path);
    fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Runs these bytes of an image on a chip of this revision.
fn run(
    bytes: &[u8],
    revision: u32,
    alarm: Range<usize>,
    ends: fn(&Registers) -> bool,
) -> Registers {
    let chip = Registers {
        alarm,
        ..Registers::of(revision, ends)
    };
    let (registers, stop) = chip.run(bytes);
    assert_eq!(stop, Stop::Asked);
    registers
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
        let chip = Registers {
            crystal,
            ..Registers::of(REVISION_1, periods)
        };
        let (registers, stop) = chip.run(&image());
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
    let periods = |registers: &Registers| registers.periods.len() > 110;
    let chip = Registers {
        crystal: Crystal::Stops(100),
        ..Registers::of(REVISION_1, periods)
    };
    let (registers, stop) = chip.run(&image());
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
