//! The interface between the component and its caller.

use siskin_params::{Board, Params};
use siskin_throttle::access::Access;
use siskin_throttle::authority::DriveStatus;

use super::group::Four;
use crate::build::BuildError;
use crate::check;
use crate::identify;
use crate::record::Record;
use crate::telemetry::Telemetry;

/// The component's surroundings: what it reads and may change.
pub struct Context<'a> {
    /// Time since the start, µs; monotonic.
    pub now_us: u64,
    /// The values in force; PARAM_SET changes them and asks for [`Request::ParamsChanged`].
    pub params: &'a mut Params,
    /// The board, whose factory values differ from the table's.
    pub board: &'a Board,
    /// The state of the ESC.
    pub telemetry: &'a Telemetry,
    /// The other ESCs that its messages cover, which run in the same program, not on the chip.
    #[cfg(feature = "group")]
    pub four: Option<&'a Four>,
    /// The result of the last self-test.
    pub check: &'a check::Report,
    /// The result of the last identification.
    pub identification: &'a identify::Report,
    /// The fault record, if there is one.
    pub record: Option<&'a Record>,
    /// Decides whether the motor may turn.
    pub authority: &'a mut dyn Access,
    /// Checks that values make a drive. While the motor turns, one that makes none is refused with the reason.
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
    /// Apply the parameters: rebuild the drive's configuration.
    ParamsChanged,
    /// Write what is stored to flash, then call [`Component::storage_done`](super::Component::storage_done).
    Save,
    /// Save without being asked.
    Keep,
    /// Read the parameters and intervals from flash and apply them, then call
    /// [`Component::storage_done`](super::Component::storage_done).
    Load,
    /// Erase all but the statistics and apply the defaults, then call
    /// [`Component::storage_done`](super::Component::storage_done).
    FactoryReset,
    /// Restart; the ACK has been sent.
    Reboot,
}

/// An action that the ESC takes at once. It reports progress if that takes longer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// Sound a beacon.
    Beep,
    /// Begin a stick calibration; [`Component::report_news`](super::Component::report_news) reports its steps.
    Calibrate,
    /// End it.
    EndCalibration,
    /// Begin an identification of the motor; its progress and end are reported like a self-test's.
    Identify,
    /// End it, if there is one.
    EndIdentification,
    /// End it since the client that began it is gone.
    AbandonIdentification,
    /// Say why the parameters keep the motor off, if they do.
    SayWhyOff,
    /// Keep its results; [`Component::identification_done`](super::Component::identification_done) reports it.
    KeepIdentified,
    /// Begin a self-test; [`Component::report_progress`](super::Component::report_progress) and
    /// [`Component::check_done`](super::Component::check_done) report it.
    Check,
}
