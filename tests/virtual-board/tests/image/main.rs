//! The image that is flashed, on the virtual board. Run with `--release`.
//!
//! | module | what it shows |
//! |---|---|
//! | [`boot`] | it starts, answers by MAVLink, and two runs are equal |
//! | [`throttle`] | DShot and pulses turn the motor, and each frame is answered at its time |
//! | [`replies`] | a flight controller's decoder reads each reply at DShot300, 600 and 1200 |
//! | [`storage`] | what is stored survives cuts of the power and resets in any write and erase |
//! | [`readings`] | shifted grounds and a chip's errors do not show in what it reads |
//! | [`self_test`] | a sound board passes its self-test, and each defect is named |
//! | [`identify`] | it finds out what motor it has, by command and by parameter, and keeps it |
//! | [`failures`] | panic, fault, standstill, break and lock-up turn the bridge off |
//! | [`damaged`] | a damaged image never turns the bridge on |
//! | [`agreement`] | the control's state and the motor are those of the emulator |
//!
//! The image is `SISKIN_IMAGE`, else what this makes:
//!
//! ```text
//! cargo run --release -p siskin -- image --board b-g431b-esc1 --output target/images
//! ```
#![forbid(unsafe_code)]

mod agreement;
mod boot;
mod common;
mod damaged;
mod failures;
mod flight_controller;
mod identify;
mod readings;
mod replies;
mod self_test;
mod storage;
mod throttle;
