//! The control law, one block of the papers a file.
//!
//! Each block is a pair of an immutable configuration, computed when the parameters change, and a
//! state. Nothing here knows of parameters, of the throttle or of time: a call is a period, or one
//! of the longer ones of the outer loops.

pub mod catch;
pub mod dead_time;
pub mod delay;
pub mod inductance;
pub mod low_speed;
pub mod modulator;
pub mod observer;
pub mod planner;
pub mod regulator;
pub mod sensing;
pub mod six_step;
pub mod speed;
pub mod start;
pub mod torque;
pub mod transform;
pub mod voltage;

/// Control periods in one of the outer loops: speed, torque and voltage.
pub const PERIODS: u32 = 8;

#[cfg(test)]
mod tests;
