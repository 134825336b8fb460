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
//! [`identify`]: crate::identify
//! [`record`]: crate::record
//! [`tune`]: crate::tune
//! [`params`]: crate::params
//! [`store`]: crate::store
//! [`mavlink`]: crate::mavlink
//! [`throttle`]: crate::throttle
//! [`esc`]: crate::esc
#![doc = include_str!("../README.md")]
//!
//! # The order of the modules
//! Dependencies run one way: {`trace`, `tune`, `checksum`, `image`} ← `math` ← {`units`, `input`} ← `control`
//! ← `protection` ← `drive` ← {`params`, `statistics`} ← {`check`, `identify`, `record`, `setpoint`, `telemetry`} ←
//! {`answer`, `mavlink`} ← {`throttle`, `store`} ← `esc`. Those in braces do not use each other. A test holds this order,
//! and that each folder has one.
//!
//! # Inlining
//! The chip's code is made as small as it can be, and the compiler inlines only what is no longer than a call. Each
//! attribute says why it is there. Those that are many:
//!
//! - `#[inline(always)] // in each period`: a call, and the registers that it saves, would cost each control period
//!   more time than the copies take flash. *In the longest period* likewise, of the outer loop.
//! - `#[inline(never)] // only some periods`: the others would save registers for it.
//!
//! One that changes neither the image nor the counts of instructions does not stay.
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
pub mod identify;
pub mod image;
pub mod input;
pub mod math;
pub mod mavlink;
pub mod params;
pub mod protection;
pub mod record;
pub mod setpoint;
pub mod statistics;
pub mod store;
pub mod telemetry;
pub mod throttle;
pub mod trace;
pub mod tune;
pub mod units;
