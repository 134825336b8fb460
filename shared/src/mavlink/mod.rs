//! The ESC as a MAVLink component: bytes in, bytes out, no socket and no clock of its own.
//!
//! [`Receiver`] turns a link's bytes into frames; [`Component`] answers them and sends telemetry. Frames that the ESC
//! sends carry `mavlink`'s generated payloads. Incoming frames are read by offset, because the generated readers refuse
//! unknown command numbers and types, which an ESC must answer. The enum of all messages is never built or read: it
//! alone takes 98 KB of flash.

mod check;
mod command;
mod component;
mod context;
mod faults;
mod frame;
mod ftp;
mod group;
mod identity;
mod messages;
mod news;
mod pace;
mod parameter;
mod payload;
mod place;
mod receiver;
mod refusal;
mod reply;
mod schedule;
mod sender;
mod signing;
mod warnings;

pub(crate) use command::NO_REBOOT_ARMED;
pub use component::Component;
pub use context::{Act, Context, Request};
pub use frame::{Address, Frame};
pub use ftp::digits;
pub use group::Four;
pub use receiver::{Counters, Receiver};
pub use schedule::Intervals;
pub use signing::{Kept as KeptSigning, Key};
pub use warnings::Warning;

#[cfg(test)]
mod tests;
