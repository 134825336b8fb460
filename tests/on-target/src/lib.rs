//! The words that a PC and the chip exchange so that both run the same control periods.
//!
//! The PC records a run of a drive on the emulator's bench: the parameters, the board, and each control
//! period's sample and set-point ([`request`]). The chip builds the same configuration from the same
//! parameters, runs the same periods, and answers with what the bridge was told, a digest of the control's
//! whole state and how many instructions that took ([`answer`]). The chip's programs are `step.rs`, and
//! `interrupt.rs` for the whole interrupt around it; they run on QEMU's `mps2-an386` board.
//!
//! A word is 32 bits, little-endian in the files.

#![no_std]
#![forbid(unsafe_code)]

pub mod answer;
pub mod request;

/// The recorded run, where the chip's program looks for it.
pub const REQUEST_FILE: &core::ffi::CStr = c"request.bin";

/// The chip program's answer.
pub const ANSWER_FILE: &core::ffi::CStr = c"answer.bin";
