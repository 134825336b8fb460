#![doc = include_str!("../README.md")]
//!
//! # Inside the crate
//! The control crate's [`step`](siskin_control::drive::step) runs in the PWM interrupt, and tasks around it. To
//! build the bare image, without the stamp that `siskin image` adds:
//!
//! ```text
//! cargo build -p siskin-firmware --release --target thumbv7em-none-eabihf --features b-g431b-esc1
//! cargo build -p siskin-firmware --release --target thumbv7em-none-eabihf --features vesc4-f405-r001
//! ```
//!
//! | part | what it is |
//! |---|---|
//! | [`board`] | one file per board: pins, converters; [how to add one](board#a-third-board-in-an-hour) |
//! | [`circuit`] | one file per board: what an ADC count is worth, for the control and for a PC that replays it |
//! | `chip` | what the HAL lacks, through its PAC: clock, flash, converter flags, comparators, the timer that wakes on an edge |
//! | [`interrupt`] | the control period: readings, set-point, `step`, duties; and its start |
//! | `edges` | the throttle wire's edges as the DMA leaves them in memory |
//! | [`exchange`] | memory shared by the interrupt and the tasks, verified with loom |
//! | [`tasks`] | throttle, MAVLink, storage, temperature, light, serial telemetry, watchdog |
//! | [`storage`] | the flash that keeps the parameters |
//! | [`last_words`] | turns the bridge off on a failure, and keeps the cause over the reset |
//! | `priority` | interrupt priorities, and critical sections that never hold up the PWM |
//! | [`image`] | board, version and commit in the image, and its integrity check |
//! | [`damaged`] | start-up of a damaged image |
//! | `link/` | the linker scripts: one per chip for its memories, one for placement |
//!
//! Chip-independent parts are tested on the host: `cargo test -p siskin-firmware --lib`.
//!
//! # Priorities
//! Lower numbers preempt higher ones. A critical section raises BASEPRI to 2.
//!
//! | interrupt | priority | cost | may delay |
//! |---|---|---|---|
//! | PWM: `ADC1_2` on the G431, `ADC` on the F405 | 0, alone | 131 instructions besides `step`, the fault record included; 133 more in every sixteenth period or so at 24 kHz, for a snapshot; and some 100 when the bridge is turned on or off | everything |
//! | gate driver's nFAULT: `EXTI15_10`, F405 | 1, alone | 20 instructions | everything but the PWM |
//! | clock (`TIM4`), serial lines, DMA, throttle timer | 2 | one waker each, below 5 µs by their length | tasks, not each other |
//! | throttle task, in the interrupt of an unused peripheral: `USART3`, `CAN2_SCE` | 2 | some 4200 instructions for a DShot600 frame and its answer, half of them after it or before the frame; up to 5 µs of waiting for a frame's last edge | the other tasks, and drivers' interrupts but not their DMA; the PWM for the 0.4 µs in which a reply starts |
//! | all other tasks | thread mode | | nothing |
//!
//! Code at priorities 0 and 1 uses no critical section, no lock, no logging and no executor type. Fault
//! handlers rank above all and do not return. An interrupt without a handler ends in [`last_words`].
//!
//! # Memory
//! | memory | written by | read by |
//! |---|---|---|
//! | control state, PWM, overruns: `.control_state`, CCM on the G431 | PWM interrupt | PWM interrupt |
//! | set-point word | throttle task | PWM interrupt |
//! | throttle side ([`tasks`]) | throttle task and, in critical sections, the MAVLink task | the same |
//! | wire edges | DMA | throttle task |
//! | bytes of the serial lines | DMA; tasks | tasks; DMA |
//! | parameters, MAVLink, storage | MAVLink task | the same |
//! | two configurations | the task that owns the parameters, only the one not in use | PWM interrupt |
//! | three snapshots | PWM interrupt | tasks |
//! | fault record: `.fault_record`, kept over a reset; only where [`record::KEPT`](siskin_control::record::KEPT) | PWM interrupt; tasks mark it as read | tasks |
//! | count of periods | PWM interrupt | tasks |
//! | last snapshot read, its reader | tasks, in a critical section | tasks |
//! | gate driver's alarm | its interrupt sets it, the PWM interrupt takes it | |
//! | TIM1 and the injected readings | start-up, then the PWM interrupt; any failure clears the main output enable | |
//! | comparator level | a task | hardware |
//! | last words | a failure | the next start |
//! | everything else | tasks | tasks |
//!
//! The stack lies at the start of RAM, so an overflow leaves the memory and hard-faults; the handler starts a
//! new stack. Start-up copies the active vector table, and the control code that a driven motor needs, out of
//! flash (`link/sections.x`); on the G431 the rest of the control stays there for lack of room.
//!
//! An erase stalls fetches from flash, for 22 ms per page on the G431 and half a second per sector on the F405.
//! It runs only with the motor at rest, from RAM, with all interrupts masked but the PWM's and the gate
//! driver's; the PWM interrupt then only holds the bridge, using functions in RAM. The image is linked with its
//! relocations, from which `siskin image` checks this.
//!
//! # When something goes wrong
//! | event | what turns the bridge off | what is reported |
//! |---|---|---|
//! | current above the hardware trip, G431 | comparators over the timer's break, without the processor | over-current |
//! | over-current, F405 | the control's own trip, within two periods; the gate driver's limiter is a strap and not relied on | over-current |
//! | gate supply undervoltage, over-temperature of the driver, F405 | the gate driver; its nFAULT also the timer and the driver's enable | over-current |
//! | set-point not renewed | `exchange`, which gives the control `Stop` | loss of signal, by the tasks |
//! | overrun, three in a row or more than one in 100 periods for long | the PWM interrupt, at the end of that period; in flight the motor is caught again | control too slow |
//! | damage to a stamped image | start-up, which never turns it on | at 115200 baud, and by the light |
//! | panic, hard fault, stack overflow, interrupt without a handler | [`last_words`], first of all | after the reset |
//! | the crystal stops, F405: the chip goes on at 16 MHz | the non-maskable interrupt's handler, and a reset | after the reset |
//! | processor lockup, G431 | the timer's break | after the watchdog's reset |
//! | processor halted by a debugger | the timer, which stops with it ([below](#a-debuggers-halt)) | nothing |
//! | tasks or interrupt stopped | the watchdog's reset: the gates' pull-downs | after the reset |
//!
//! # A debugger's halt
//! With DBG_TIM1_STOP the counter stops with the processor, and "the outputs are disabled (as if the MOE bit
//! was reset)" (RM0440, debug mode of TIM1; RM0090, 38.16.2); OSSI then drives them to their idle level, low,
//! so both switches of each phase are off. MOE itself stays set: when the processor resumes, so does the PWM
//! with its last duties, although the motor has meanwhile run free; what the current then does is up to the
//! trips. The watchdog keeps running, and resets a chip that is halted for longer than 1.6 s. The program sets
//! the bit at start-up, and it outlives every reset but a power-up; before that, the gates have their
//! pull-downs. A debugger may clear it, or stop the watchdog. None of this has been verified on a board yet.
//!
//! # What no board has shown yet
//! None of this has run on a board. Pins and alternate functions agree with the metadata of `stm32-metapac`: on
//! the F405 the HAL's types would accept no others, on the G431 they are numbers. That the comparators' inputs,
//! DAC3's channels and the break's bits are as `chip` has them is from the reference manual alone. Of the
//! boards, these could not be checked: the order and the sign of the VESC's two shunts, the order of its Hall
//! sensors, the amplifiers' settling times, how the straps of a DRV8302 are set, the thermistor of the
//! B-G431B-ESC1, and where the second resistor of its shunts' ground goes. The end of a reply assumes that a timer whose UDE is cleared
//! requests no more words (RM0440 does not say so); the VESC's reply, by TIM3's forced output, runs on no
//! virtual board.
#![cfg_attr(not(test), no_std)]

#[cfg(any(
    all(feature = "b-g431b-esc1", feature = "vesc4-f405"),
    all(feature = "vesc4-f405-r0005", feature = "vesc4-f405-r001"),
    all(feature = "vesc4-f405-r0005", feature = "vesc4-f405-r005"),
    all(feature = "vesc4-f405-r001", feature = "vesc4-f405-r005"),
))]
compile_error!("choose one board, not two");

// Linked only for its transport.
#[cfg(all(board, feature = "defmt"))]
use defmt_rtt as _;

#[cfg(board)]
pub mod board;
#[cfg(board)]
mod chip;
pub mod circuit;
#[cfg(any(board, test))]
pub mod damaged;
#[cfg(any(board, test))]
mod edges;
pub mod exchange;
#[cfg(any(board, test))]
mod hall;
pub mod image;
pub mod interrupt;
pub mod last_words;
#[cfg(any(board, test))]
mod pace;
#[cfg(target_os = "none")]
mod priority;
#[cfg(board)]
pub mod storage;
#[cfg(board)]
pub mod tasks;
mod text;
