//! The image on the virtual board against the shared code on this machine.
//!
//! ```text
//! cargo run --release -p siskin -- image --board b-g431b-esc1 --output target/images
//! cargo test --release -p siskin-vboard agreement -- --nocapture
//! ```
//!
//! | test | what agrees |
//! |---|---|
//! | [`word_for_word`] | each word of the control state, and the compare values, in each period: the chip's against the same code here with the same readings |
//! | [`same_run`] | speed, current and duty against the emulator's run with the same throttle, as far as physics allows |
//!
//! The image is `SISKIN_IMAGE`, or else the one that the first command makes.

mod mirror;
mod places;
mod same_run;
mod scenario;
mod word_for_word;
