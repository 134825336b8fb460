//! [`control`]: crate::control
//! [`build`]: crate::build
//! [`protection`]: crate::protection
//! [`drive`]: crate::drive
//! [`telemetry`]: crate::telemetry
//! [`statistics`]: crate::statistics
//! [`answer`]: crate::answer
//! [`check`]: crate::check
//! [`identify`]: crate::identify
//! [`record`]: crate::record
//! [`tune`]: crate::tune
//! [`store`]: crate::store
//! [`mavlink`]: crate::mavlink
//! [`throttle`]: crate::throttle
//! [`esc`]: crate::esc
#![doc = include_str!("../README.md")]
//!
//! # Module order
//! Dependencies run one way: {`tune`, `image`} ← `control` ← `protection` ← `drive` ← {`build`, `statistics`}
//! ← {`check`, `identify`, `record`, `setpoint`, `settings`, `telemetry`} ← {`answer`, `mavlink`} ← {`throttle`, `store`}
//! ← `esc`. Modules in the same braces do not use each other. A test enforces this order, and that every folder has a
//! place in it.
//!
//! # Inlining
//! The chip build optimises for size, so the compiler inlines only what is no longer than a call. Every inline
//! attribute states its reason. The common ones:
//!
//! - `#[inline(always)] // in each period`: a call and its register saves would cost every control period more
//!   time than the copies cost flash. *In the longest period* means the same for the outer loop.
//! - `#[inline(never)] // only some periods`: inlined, it would make the other periods save registers for it
//!   too.
//!
//! An attribute that changes neither the image nor the instruction counts is removed.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod answer;
pub mod build;
pub mod check;
pub mod control;
pub mod drive;
pub mod esc;
pub mod identify;
pub mod image;
pub mod mavlink;
pub mod protection;
pub mod record;
pub mod setpoint;
mod settings;
pub mod statistics;
pub mod store;
pub mod telemetry;
pub mod throttle;
pub mod tune;
