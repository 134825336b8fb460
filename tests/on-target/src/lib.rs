//! The words that a PC and the chip exchange so that both do the same control periods.
//!
//! The PC records a run of a drive on the emulator's bench: the parameters, the board, and of each
//! control period the sample and the set-point ([`request`]). The chip makes the same configuration
//! of the same parameters, does the same periods, and answers with what the bridge was told, a
//! digest of the control's whole state and how many instructions that took ([`answer`]). The
//! programs for the chip are `step.rs`, and `interrupt.rs` for the whole interrupt around it; QEMU's
//! board `mps2-an386` runs them.
//!
//! A word is 32 bits, little-endian in the files.

#![no_std]
#![forbid(unsafe_code)]

pub mod answer;
pub mod request;

/// The recorded run, where the chip's program looks for it.
pub const REQUEST_FILE: &core::ffi::CStr = c"request.bin";

/// What the chip's program answers.
pub const ANSWER_FILE: &core::ffi::CStr = c"answer.bin";
