//! Files that can be read over MAVLink: <https://mavlink.io/en/services/ftp.html>.
//!
//! | file | contents |
//! |---|---|
//! | `@PARAM/param.pck` | every parameter, as ArduPilot packs them: 3 frames where the list takes 50; with `?withdefaults=1` or `?start=N&count=N` |
//! | `@SYS/faults.txt` | faults and the last warning, in words |
//! | `@SYS/faults.bin` | the [fault record](crate::record), while the motor is at rest or a trip holds it; if the program [keeps](crate::record::KEPT) one |
//! | `@SYS/statistics.txt` | statistics over the life of the ESC, in words |
//! | `@SYS/check.txt` | the last self-test, in words |
//! | `@SYS/identify.txt` | what the last identification found, in words |
//! | `general.json.xz` | the place of the next one ([`metadata()`] has that of this one) |
//! | `parameter.json.xz` | units, ranges, choices and descriptions of the parameters, for a ground station to show |
//!
//! The last two are made from the parameter table when the crate is built (`build.rs`). The others are rewritten for
//! each answer, of which only the requested part is kept: no file is ever in memory. One reader at a time has a
//! session, which nobody else can end. It reads a snapshot: once the contents have changed, reads fail. Bursts share
//! half of the link with the parameter lists, and only a few requests of a flood are answered.

mod answer;
mod error;
mod files;
mod metadata;
mod packed;
mod payload;
mod server;
mod sink;
mod text;
mod view;

pub(super) use answer::{Answer, PAYLOAD_MAX};
pub(super) use metadata::{is_metadata, metadata};
pub(super) use server::Server;
pub use text::digits;
pub(super) use view::View;

#[cfg(test)]
mod tests;
