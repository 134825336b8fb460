//! The Siskin ESC's control against a simulated motor, inverter, battery and wire.
//!
//! [`rig`] runs the control's step against the [`plant`], period by period. [`device`] puts the
//! tasks' side of the ESC, the throttle [`wire`] and the [`flash`] around it. [`live`] runs that in
//! real time on the MAVLink [`link`]s, and [`scenario`] runs it offline from a file. [`watch`] looks on
//! for the [`summary`] and for the [`record`], in the [`shaft`]'s own direction, and [`plot`] draws.
//! A [`fault`] breaks something of all this at a given time. [`reproduce`] measures the papers' own
//! figures, [`measure`] how fast all this is against a [`yardstick`].
#![forbid(unsafe_code)]

pub mod bench;
pub mod device;
pub mod fault;
pub mod flash;
pub mod interrupt;
pub mod link;
pub mod live;
pub mod machine;
pub mod measure;
pub mod options;
pub mod parameter;
pub mod plant;
#[cfg(feature = "plot")]
pub mod plot;
pub mod record;
pub mod report;
#[cfg(feature = "plot")]
pub mod reproduce;
pub mod rig;
pub mod scenario;
pub mod shaft;
pub mod summary;
pub mod surroundings;
pub mod watch;
pub mod wire;
pub mod yardstick;
