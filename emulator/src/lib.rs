//! [`rig`]: crate::rig
//! [`plant`]: crate::plant
//! [`device`]: crate::device
//! [`rack`]: crate::rack
//! [`wire`]: crate::wire
//! [`flash`]: crate::flash
//! [`live`]: crate::live
//! [`lockstep`]: crate::lockstep
//! [`laboratory`]: crate::laboratory
//! [`link`]: crate::link
//! [`web`]: crate::web
//! [`scenario`]: crate::scenario
//! [`watch`]: crate::watch
//! [`summary`]: crate::summary
//! [`record`]: crate::record
//! [`shaft`]: crate::shaft
//! [`fault`]: crate::fault
//! [`matrix`]: crate::matrix
//! [`measure`]: crate::measure
//! [`yardstick`]: crate::yardstick
#![cfg_attr(feature = "plot", doc = "[`plot`]: crate::plot")]
#![cfg_attr(feature = "plot", doc = "[`reproduce`]: crate::reproduce")]
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod bench;
pub mod device;
pub mod fault;
pub mod flash;
pub mod interrupt;
pub mod laboratory;
pub mod link;
pub mod live;
pub mod lockstep;
pub mod machine;
pub mod matrix;
pub mod measure;
pub mod options;
pub mod parameter;
pub mod plant;
#[cfg(feature = "plot")]
pub mod plot;
pub mod rack;
pub mod record;
#[cfg(test)]
mod reference;
pub mod report;
#[cfg(feature = "plot")]
pub mod reproduce;
pub mod rig;
pub mod scenario;
pub mod shaft;
pub mod summary;
pub mod surroundings;
pub mod watch;
pub mod web;
pub mod wire;
pub mod yardstick;
