//! The control law: one block of the papers per file.
//!
//! Each block pairs an immutable configuration, computed when the parameters change, with a state.
//! Nothing here knows of parameters, throttle or time: one call is one control period, or one of
//! the outer loops' longer periods.

pub mod catch;
pub mod dead_time;
pub mod inductance;
pub mod low_speed;
pub mod modulator;
pub mod observer;
pub mod overmodulation;
pub mod planner;
pub mod regulator;
pub mod sensing;
pub mod six_step;
pub mod speed;
pub mod start;
pub mod torque;
pub mod transform;
pub mod voltage;
pub mod weakening;

/// Control periods per period of the outer loops: speed, torque and voltage.
pub const PERIODS: u32 = 8;

#[cfg(test)]
mod tests;
