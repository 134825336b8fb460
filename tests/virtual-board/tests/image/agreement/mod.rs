//! The image on the virtual board against the shared code on this machine.
//!
//! ```text
//! cargo run --release -p siskin -- image --board b-g431b-esc1 --output target/images
//! cargo test --release -p siskin-vboard agreement -- --nocapture
//! ```
//!
//! | test | what agrees |
//! |---|---|
//! | [`word_for_word`] | each word of the control state, and the compare values, in each period: the chip's with what the same code makes of the same readings here |
//! | [`same_run`] | speed, current and duty with the emulator's run of the same throttle, as far as physics lets them |
//!
//! The image is `SISKIN_IMAGE`, else the one that the first line makes.

mod mirror;
mod places;
mod same_run;
mod scenario;
mod word_for_word;
