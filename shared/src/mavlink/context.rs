//! The interface of the component to its caller.

use super::group::Four;
use crate::check;
use crate::identify;
use crate::input::access::Access;
use crate::input::authority::DriveStatus;
use crate::params::{Board, BuildError, Params};
use crate::record::Record;
use crate::telemetry::Telemetry;

/// The component's surroundings: what it reads and may change.
pub struct Context<'a> {
    /// Time since the start, µs; it does not run backwards.
    pub now_us: u64,
    /// The values in force; PARAM_SET changes them and asks for [`Request::ParamsChanged`].
    pub params: &'a mut Params,
    /// The board, which has other values from the factory than the table's.
    pub board: &'a Board,
    /// The state of the ESC.
    pub telemetry: &'a Telemetry,
    /// The ESCs of which its messages tell besides; they are one program's, and not the chip's.
    #[cfg(feature = "group")]
    pub four: Option<&'a Four>,
    /// The result of the last self-test.
    pub check: &'a check::Report,
    /// The result of the last identification.
    pub identification: &'a identify::Report,
    /// The fault record, where there is one.
    pub record: Option<&'a Record>,
    /// Decides whether the motor may turn.
    pub authority: &'a mut dyn Access,
    /// Checks that values make a drive; a value that breaks it is refused with the reason.
    pub validate: &'a dyn Fn(&Params) -> Result<(), BuildError>,
}

impl<'a> Context<'a> {
    pub(super) fn four(&self) -> Option<&'a Four> {
        #[cfg(feature = "group")]
        let four = self.four;
        #[cfg(not(feature = "group"))]
        let four = None;
        four
    }

    pub(super) fn drive(&mut self) -> DriveStatus {
        self.telemetry.drive(self.authority.command())
    }
}

/// A request that only the caller can carry out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Put the parameters in force: rebuild the drive's configuration.
    ParamsChanged,
    /// Write what is kept to flash, then call [`Component::storage_done`](super::Component::storage_done).
    Save,
    /// Save without being asked.
    Keep,
    /// Read the parameters and intervals from flash and put them in force, then call
    /// [`Component::storage_done`](super::Component::storage_done).
    Load,
    /// Erase all but the statistics and put the defaults in force, then call
    /// [`Component::storage_done`](super::Component::storage_done).
    FactoryReset,
    /// Start again; the ACK has been sent.
    Reboot,
}

/// An act that the ESC does at once. It reports progress if the act takes longer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// Sound a beacon.
    Beep,
    /// Begin a calibration by stick; [`Component::tell`](super::Component::tell) reports its steps.
    Calibrate,
    /// End it.
    EndCalibration,
    /// Begin an identification of the motor; its progress and end are told as those of a self-test are.
    Identify,
    /// End it, if there is one.
    EndIdentification,
    /// Keep what it has found; [`Component::check_done`](super::Component::check_done) reports it.
    KeepIdentified,
    /// Begin a self-test; [`Component::tell_progress`](super::Component::tell_progress) and [`Component::check_done`](super::Component::check_done) report it.
    Check,
}
