//! The flashed image on the virtual board. Run with `--release`.
//!
//! | module | what it shows |
//! |---|---|
//! | [`boot`] | it starts, answers by MAVLink, and two runs are equal |
//! | [`throttle`] | DShot and pulses turn the motor, and each frame is answered on time |
//! | [`replies`] | a flight controller's decoder reads each reply at DShot300, 600 and 1200 |
//! | [`pins`] | pins that wires from outside reach rest high, and nothing drives against a sensor |
//! | [`storage`] | what is stored survives power cuts and resets during any write and erase |
//! | [`readings`] | shifted grounds and the chip's errors do not show in its readings |
//! | [`self_test`] | a sound board passes its self-test, and each defect is named |
//! | [`identify`] | it identifies its motor, by command and by parameter, and keeps the result |
//! | [`failures`] | panic, fault, standstill, break and lockup turn the bridge off |
//! | [`overruns`] | periods that take too long turn the bridge off, and a flight goes on after them |
//! | [`cycles`] | every mode's longest period fits at any PWM frequency that is accepted |
//! | [`damaged`] | a damaged image never turns the bridge on |
//! | [`agreement`] | the control's state and the motor agree with the emulator's |
//!
//! The image is `SISKIN_IMAGE`, or else what this makes:
//!
//! ```text
//! cargo run --release -p siskin -- image --board b-g431b-esc1 --output target/images
//! ```
#![forbid(unsafe_code)]

mod agreement;
mod boot;
mod common;
mod cycles;
mod damaged;
mod failures;
mod flight_controller;
mod identify;
mod overruns;
mod pins;
mod readings;
mod replies;
mod self_test;
mod storage;
mod throttle;
