//! The authority as others than the wire use it. It may belong to a task that interrupts them.

use super::authority::{Authority, Command, Denied, DriveStatus, TestError};

/// The requests that others than the wire may make of the [`Authority`], each at one moment.
pub trait Access {
    /// As [`Authority::command`].
    fn command(&mut self) -> Command;

    /// As [`Authority::armed`].
    fn armed(&mut self) -> bool;

    /// As [`Authority::disarm`].
    fn disarm(&mut self);

    /// As [`Authority::arm`].
    ///
    /// # Errors
    /// As there.
    fn arm(&mut self, now_us: u64) -> Result<(), Denied>;

    /// As [`Authority::actuator_test`].
    ///
    /// # Errors
    /// As there.
    fn actuator_test(
        &mut self,
        now_us: u64,
        value: f32,
        duration_s: f32,
        drive: DriveStatus,
    ) -> Result<(), TestError>;

    /// As [`Authority::may_test`].
    fn may_test(&mut self, now_us: u64, drive: DriveStatus) -> bool;
}

impl Access for Authority {
    fn command(&mut self) -> Command {
        Authority::command(self)
    }

    fn armed(&mut self) -> bool {
        Authority::armed(self)
    }

    fn disarm(&mut self) {
        Authority::disarm(self);
    }

    fn arm(&mut self, now_us: u64) -> Result<(), Denied> {
        Authority::arm(self, now_us)
    }

    fn actuator_test(
        &mut self,
        now_us: u64,
        value: f32,
        duration_s: f32,
        drive: DriveStatus,
    ) -> Result<(), TestError> {
        Authority::actuator_test(self, now_us, value, duration_s, drive)
    }

    fn may_test(&mut self, now_us: u64, drive: DriveStatus) -> bool {
        Authority::may_test(self, now_us, drive)
    }
}
