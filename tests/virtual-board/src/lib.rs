#![doc = include_str!("../README.md")]
//!
//! # Inside the crate
//! | part | what it is |
//! |---|---|
//! | [`image`] | the linker's file: what is flashed where |
//! | [`memory`] | memory that the processor and the DMA share |
//! | [`processor`] | the Cortex-M4F: an engine that translates, one that interprets, and what an instruction costs |
//! | [`chip`] | the STM32G431's parts, one file each, at the level of their registers |
//! | [`board`] | the B-G431B-ESC1's resistors between the chip's pins and the bench |
//! | [`world`] | chip and bench together: time, signals, gates, samples |
//! | [`bridge`] | an independent check of the gates: overlap and dead time |
//! | [`throttle`], [`serial`] | the far ends of the wires |
//! | [`load`] | figures of the PWM interrupt |
//! | [`machine`] | all this as the emulator's library runs it |
//!
//! # What is simulated how
//! The chip is what its registers say: only the firmware's image is used. An access to a register that is not
//! modelled, or whose part has no clock, ends the run with its address and the instruction's; so does a clock
//! beyond the chip's limits.
//!
//! Time advances by the executed instructions, with [an estimate of their cycles](processor#what-code-costs),
//! and by what the parts do at their own times. Motor, inverter and supply are the emulator's; they follow the
//! gates edge by edge, and are read when a converter's sampling ends. Equal inputs give equal bits.

pub mod board;
pub mod bridge;
pub mod chip;
pub mod gate_supply;
pub mod image;
pub mod load;
pub mod machine;
pub mod memory;
pub mod processor;
pub mod serial;
pub mod throttle;
pub mod time;
pub mod world;
