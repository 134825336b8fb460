//! Access to the authority for callers other than the wire. Its owner may be a task that preempts them.

use super::authority::{Authority, Command, Denied, DriveStatus, TestError};

/// The requests that others than the wire may make of the [`Authority`]; each is atomic.
pub trait Access {
    /// See [`Authority::command`].
    fn command(&mut self) -> Command;

    /// See [`Authority::armed`].
    fn armed(&mut self) -> bool;

    /// See [`Authority::disarm`].
    fn disarm(&mut self);

    /// See [`Authority::arm`].
    ///
    /// # Errors
    /// Those of [`Authority::arm`].
    fn arm(&mut self, now_us: u64) -> Result<(), Denied>;

    /// See [`Authority::actuator_test`].
    ///
    /// # Errors
    /// Those of [`Authority::actuator_test`].
    fn actuator_test(
        &mut self,
        now_us: u64,
        value: f32,
        duration_s: f32,
        drive: DriveStatus,
    ) -> Result<(), TestError>;

    /// See [`Authority::may_test`].
    fn may_test(&mut self, now_us: u64, drive: DriveStatus) -> bool;

    /// See [`Authority::barred`].
    fn barred(&mut self) -> bool;
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

    fn barred(&mut self) -> bool {
        Authority::barred(self)
    }
}
