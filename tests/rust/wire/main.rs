//! The throttle wire's decoder against senders with errors, and against noise.
//!
//! Everything goes through `input::line::Line`, as edges in ticks of the capture timer.

mod detection;
mod frames;
mod noise;
mod sender;
