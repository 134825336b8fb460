//! [`math`]: crate::math
//! [`units`]: crate::units
//! [`input`]: crate::input
//! [`control`]: crate::control
//! [`protection`]: crate::protection
//! [`drive`]: crate::drive
//! [`telemetry`]: crate::telemetry
//! [`statistics`]: crate::statistics
//! [`answer`]: crate::answer
//! [`check`]: crate::check
//! [`tune`]: crate::tune
//! [`params`]: crate::params
//! [`store`]: crate::store
//! [`mavlink`]: crate::mavlink
//! [`throttle`]: crate::throttle
//! [`esc`]: crate::esc
#![doc = include_str!("../README.md")]
//!
//! # The order of the modules
//! Dependencies run one way: `trace` ← `math` ← `units` ← {`input`, `control`, `protection`} ← `drive` ←
//! {`telemetry`, `statistics`} ← `check` ← {`throttle`, `mavlink`} ← `store` ← `esc`. `params` builds the
//! configurations of the others.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod answer;
pub mod check;
mod checksum;
pub mod control;
pub mod drive;
pub mod esc;
pub mod image;
pub mod input;
pub mod math;
pub mod mavlink;
pub mod params;
pub mod protection;
pub mod setpoint;
pub mod statistics;
pub mod store;
pub mod telemetry;
pub mod throttle;
pub mod trace;
pub mod tune;
pub mod units;

/// True with the self-test ([`check`]), by the feature `self-test`. Without it the command for one is
/// UNSUPPORTED, and nothing is kept for it.
pub const SELF_TEST: bool = cfg!(any(test, feature = "self-test"));
