//! Everything that decides in the Siskin ESC: the same source, and the same bits, on the chip and
//! on a PC.
//!
//! # The way of the data
//! Edges of the throttle wire become frames, and frames become a command where something may turn
//! the motor ([`input`]). The command becomes a set-point ([`setpoint`]), and with a sample of the
//! converter a bridge's next period ([`drive::step`]), by way of the papers' blocks ([`control`])
//! and the limits ([`protection`]). What the drive has done becomes [`telemetry`], and that goes
//! out by [`mavlink`]. [`params`] turns the table of parameters into the configuration that all of
//! it reads, and [`store`] keeps them, with [`statistics`] and what else survives. [`tune`] has the tunes that the motor plays. [`check`] is
//! the self-test. [`throttle`] and [`esc`] tie together what is outside the PWM interrupt.
//!
//! Dependencies run one way: `trace` ← `math` ← `units` ← {`input`, `control`, `protection`} ← `drive` ←
//! {`telemetry`, `statistics`} ← `check` ← {`throttle`, `mavlink`} ← `store` ← `esc`. `params` builds the configurations of the others.
//!
//! # Numbers
//! Fixed point with the fraction bits in the type ([`math`]), in units in which a product needs
//! only its top half ([`units`]). Floating point is for parameters and telemetry, with `libm`'s
//! functions, so that every machine computes the same coefficients.
//!
//! # Papers
//! - A. Bosso, C. Conficoni, D. Raggini, A. Tilli, "A Computational-Effective Field-Oriented
//!   Control Strategy for Accurate and Efficient Electric Propulsion of Unmanned Aerial Vehicles",
//!   IEEE/ASME Transactions on Mechatronics 26(3), 2021: the *first paper*; equation numbers are
//!   its.
//! - S. Colton, "Flux Observer-Based Sensorless Field-Oriented Control of Surface Permanent Magnet
//!   Synchronous Motors", 2014: the *second
//!   paper*.
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

/// Whether there is a self-test ([`check`]), by the feature `self-test`. Without it the command for one is
/// UNSUPPORTED, and nothing is kept for it.
pub const SELF_TEST: bool = cfg!(any(test, feature = "self-test"));
