//! The throttle wire's decoder against senders that stray, and against noise.
//!
//! Everything goes through `input::line::Line`, as edges in ticks of the capturing timer.

mod detection;
mod frames;
mod noise;
mod sender;
