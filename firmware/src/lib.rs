#![doc = include_str!("../README.md")]
//!
//! # Inside the crate
//! The control crate's [`step`](siskin_control::drive::step) runs in the PWM interrupt, and tasks around it.
//! The image alone, without the stamp that `siskin image` adds:
//!
//! ```text
//! cargo build -p siskin-firmware --release --target thumbv7em-none-eabihf --features b-g431b-esc1
//! cargo build -p siskin-firmware --release --target thumbv7em-none-eabihf --features vesc4-f405
//! ```
//!
//! | part | what it is |
//! |---|---|
//! | [`board`] | one file a board: pins, converters; [how to add one](board#a-third-board-in-an-hour) |
//! | [`circuit`] | one file a board: what a count is worth, for the control and for a PC that replays it |
//! | `chip` | clock, flash, converters' flags, comparators, the timer that wakes at an edge: what the HAL does not have, by its PAC |
//! | [`interrupt`] | the control period: readings, set-point, `step`, duties; and its start |
//! | `edges` | the throttle wire's edges as the DMA leaves them in memory |
//! | [`exchange`] | the memory that the interrupt and the tasks share, proven with loom |
//! | [`tasks`] | throttle, MAVLink, storage, temperature, light, serial telemetry, watchdog |
//! | [`storage`] | the flash that keeps the parameters |
//! | [`last_words`] | a failure turns the bridge off, and what happened is kept over the reset |
//! | `priority` | priorities, and critical sections that never hold up the PWM |
//! | [`image`] | board, version and commit in the image, and whether it is whole |
//! | [`damaged`] | the start of an image that is not |
//! | `link/` | the linker script: a file a chip for its memories, one for the placement |
//!
//! Parts that need no chip are tested on the host: `cargo test -p siskin-firmware --lib`.
//!
//! # Priorities
//! A smaller number comes first. A critical section raises BASEPRI to 2.
//!
//! | interrupt | priority | takes | may hold up |
//! |---|---|---|---|
//! | PWM: `ADC1_2` on the G431, `ADC` on the F405 | 0, alone | 107 instructions besides `step`, 102 more in every eighth period, and some 120 when the bridge is turned on or off | everything |
//! | nFAULT of the gate driver: `EXTI15_10`, F405 | 1, alone | 20 instructions | all but the PWM |
//! | clock (`TIM4`), serial lines, DMA, throttle's timer | 2 | a waker each, below 5 µs by their length | tasks; not each other |
//! | the throttle's task, by an interrupt whose unit is not used: `FMAC`, `CAN2_SCE` | 2 | some 4200 instructions for a DShot600 frame and its answer, half of them behind it or before the frame; up to 5 µs of waiting for a frame's last edge | the other tasks, and drivers' interrupts, not their DMA; the PWM for the 0.4 µs in which a reply is begun |
//! | the other tasks | thread mode | | nothing |
//!
//! Code at priorities 0 and 1 uses no critical section, no lock, no log and no type of the executor. A
//! fault's handlers are above all and do not return. An interrupt that the chip has and nobody
//! handles ends in [`last_words`].
//!
//! # Memory
//! | memory | written by | read by |
//! |---|---|---|
//! | control state, PWM, overruns: `.control_state`, CCM on the G431 | PWM interrupt | PWM interrupt |
//! | set-point's word | the throttle's task | PWM interrupt |
//! | the throttle's side ([`tasks`]) | the throttle's task and, in critical sections, the MAVLink task | the same |
//! | edges of the wire | DMA | the throttle's task |
//! | bytes of the serial lines | DMA; tasks | tasks; DMA |
//! | parameters, MAVLink, storage | the MAVLink task | the same |
//! | two configurations | the task of the parameters, only the one not in use | PWM interrupt |
//! | three snapshots | PWM interrupt | tasks |
//! | fault record: `.fault_record`, kept over a reset; only where [`record::KEPT`](siskin_control::record::KEPT) | PWM interrupt; tasks mark it as read | tasks |
//! | counts of periods and overruns | PWM interrupt | tasks |
//! | last snapshot read, its reader | tasks, in a critical section | tasks |
//! | the gate driver's alarm | its interrupt sets it, the PWM interrupt takes it | |
//! | TIM1 and the injected readings | the start, then the PWM interrupt; the main output's *off* by any failure | |
//! | comparators' level | a task | hardware |
//! | last words | a failure | the next start |
//! | all else | tasks | tasks |
//!
//! RAM begins with the stack, so one that overflows leaves the memory: that is a hard fault, whose
//! handler begins a new stack. The vector table in use, and what of the control a driven motor needs,
//! are copied out of flash at the start (`link/sections.x`); on the G431 the rest of the control stays
//! there for want of room.
//!
//! An erase stalls what is fetched from the flash, 22 ms a page on the G431 and half a second a sector
//! on the F405. It is made only with the motor at rest, by code in RAM with all interrupts held off but
//! the PWM's and the gate driver's; and the PWM interrupt then only holds the bridge, by functions that
//! lie in RAM. The image is linked with its relocations, by which `siskin image` checks this.
//!
//! # When something goes wrong
//! | event | what turns the bridge off | what is reported |
//! |---|---|---|
//! | current above the hardware's trip, G431 | comparators over the timer's break, without the processor | over-current |
//! | over-current, F405 | the control's own trip, within two periods; the gate driver's limiter is a strap and not counted on | over-current |
//! | low supply of the gates, over-temperature of the driver, F405 | the gate driver; its nFAULT also the timer and the driver's enable | over-current |
//! | set-point not renewed | `exchange`, which gives the control `Stop` | loss of signal, by the tasks |
//! | overrun, three in a row or more than one in 100 periods for long | [`last_words`] | after the reset |
//! | damage to a stamped image | its start, which never turns it on | at 115200 baud, and by the light |
//! | panic, hard fault, stack overflow, interrupt without a handler | [`last_words`], first of all | after the reset |
//! | processor locked up, G431 | the timer's break | after the watchdog's reset |
//! | a debugger halts the processor | the timer, which stops with it ([below](#a-debuggers-halt)) | nothing |
//! | tasks or interrupt stop | the watchdog's reset: the gates' pull-downs | after the reset |
//!
//! # A debugger's halt
//! With DBG_TIM1_STOP the counter stops with the processor, and "the outputs are disabled (as if the MOE bit
//! was reset)" (RM0440, debug mode of TIM1; RM0090, 38.16.2); OSSI then drives them to their idle level,
//! low. So both switches of each phase are off. MOE itself stays: if the processor goes on, so does the
//! PWM with its last duties, and the motor has meanwhile done as it likes; what the current does then is the
//! trips'. The watchdog does not stop, and resets a chip that is halted for longer than 1.6 s. The bit is
//! set when the program starts and outlives all resets but a power-up; before, the gates have their
//! pull-downs. A debugger may clear it, or stop the watchdog. No board has shown any of this yet.
//!
//! # What no board has shown yet
//! None of this has run on a board. Pins and alternate functions agree with the metadata of
//! `stm32-metapac`: on the F405 the HAL's types would not take others, on the G431 they are numbers; that the comparators' inputs, DAC3's
//! channels and the break's bits are as `chip` has them is from the reference manual alone. Of the
//! boards, these could not be checked: the order and the sign of the VESC's two shunts, the amplifiers'
//! settling times, how the straps of a DRV8302 are set, the thermistor of the B-G431B-ESC1, and what its
//! second resistor of each shunt's ground goes to. A reply's end takes it that a timer whose UDE is cleared
//! asks for no word any more (RM0440 does not say it); the VESC's reply, by TIM3's forced output, runs on
//! no virtual board.
#![cfg_attr(not(test), no_std)]

#[cfg(all(feature = "b-g431b-esc1", feature = "vesc4-f405"))]
compile_error!("choose one board, not two");

// Linked for its transport alone.
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
