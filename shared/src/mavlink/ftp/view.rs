//! The sources of the files.

use siskin_params::{Board, Params};

use crate::check;
use crate::identify;
use crate::record::Record;
use crate::telemetry::Telemetry;

/// The sources of the files that are produced when read.
#[derive(Clone, Copy)]
pub(in crate::mavlink) struct View<'a> {
    pub(in crate::mavlink) params: &'a Params,
    pub(in crate::mavlink) board: &'a Board,
    pub(in crate::mavlink) telemetry: &'a Telemetry,
    /// The result of the last self-test.
    pub(in crate::mavlink) check: &'a check::Report,
    /// The result of the last identification.
    pub(in crate::mavlink) identification: &'a identify::Report,
    /// The fault record, if there is one.
    pub(in crate::mavlink) record: Option<&'a Record>,
    /// The last warning; empty if there was none.
    pub(in crate::mavlink) warning: &'a str,
}
