//! The scope: a page in the browser that shows an ESC, and its server.
//!
//! The page is a MAVLink client, as a ground station is: parameters, commands and telemetry are MAVLink frames over
//! its socket. The emulator shows more by it, `siskin scope` an ESC on a link.

#![forbid(unsafe_code)]

mod address;
mod assets;
mod greeting;
mod guard;
mod head;
mod hub;
pub mod printable;
mod recording;
mod server;
mod show;
mod site;
mod viewer;
mod waiting;

pub use address::{AddressError, HostPort};
pub use greeting::greeting;
pub use hub::{ORDERS, Order, ViewerId, What};
pub use show::Show;
pub use site::{Site, SiteError};

/// A binary message of the socket that begins with this byte is MAVLink, in either direction. Others begin with
/// another one, and are answers of [`Show::answer`].
pub const MAVLINK: u8 = 0;
