//! Requests for storage, one at a time: how each ends must reach the one who asked. What has changed
//! is stored without being asked for.

use core::ops::Range;

use embedded_storage::nor_flash::NorFlash;

use crate::mavlink::Request;
use crate::params::ParamId;
use crate::store::{self, Kept, StoreError};

/// Time without a change after which changes are stored, µs: a client that writes a whole
/// list of parameters wears the flash once.
const QUIET_US: u64 = 1_000_000;
/// Longest wait while changes keep coming, µs, and saves without a request are left ([`SAVES_AT_ONCE`]); else
/// it is [`SAVE_EVERY_US`]. Signed frames heard in this time can be played again after a loss of power.
const LATEST_US: u64 = 2_000_000;

/// Saves without a request that may follow one another at once. An evening of trying one value
/// after another takes as many.
const SAVES_AT_ONCE: u64 = 100;
/// Time that earns one more of them, µs. A client that keeps changing a value costs 100 + 480 of the flash's
/// 40 000 saves on its first day, 1.5 %.
const SAVE_EVERY_US: u64 = 180_000_000;
/// Longest wait for the first of them after a start, µs, where all were taken before it: a person who
/// has the ESC on for a minute keeps the changes. A client that changes a value and restarts the ESC,
/// for a day, costs 100 + 1440 saves, 3.9 %.
const FIRST_SAVE_US: u64 = 60_000_000;
/// What may be owed while one more save is made, µs.
const OWED_MAX_US: u64 = (SAVES_AT_ONCE - 1) * SAVE_EVERY_US;

/// Time between two reminders that settings were lost, µs: a station may have come since.
const REMIND_US: u64 = 10_000_000;

/// The warning to a person, and the refusal to store something else beside lost settings.
pub(super) const LOST: &str = "Settings lost: set and store them, or reset them";

/// The sender of the request for storage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Asker {
    /// A command or a calibration on the throttle wire.
    Wire,
    /// A MAVLink command, which is acknowledged.
    Mavlink,
    /// Nobody: something has changed.
    Nobody,
}

/// When what is to be stored has changed.
#[derive(Clone, Copy, Debug)]
struct Changes {
    /// Time of the first change.
    first_us: u64,
    /// Time of the last one.
    last_us: u64,
}

/// Requests that wait, and the one under way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Storage {
    /// MAVLink has one at a time, and refuses others.
    mavlink: Option<Request>,
    save: bool,
    /// What is to be stored without being asked for.
    changes: Option<Changes>,
    /// Time at which all saves without a request are available again.
    refilled_us: u64,
    /// How far off that was at the last of them, s, to be stored with it.
    owed_s: u32,
    /// True if the ESC is to restart when nothing waits any more.
    reboot: bool,
    /// Whose request the caller has been given.
    under_way: Option<(Asker, Request)>,
    /// True if it has been reported that changes cannot be stored.
    failed: bool,
    /// True if the stored settings cannot be in force: they stay, and nothing turns the motor, until
    /// somebody asks for settings to be stored or reset.
    lost: bool,
    /// Time of the last reminder.
    reminded_us: u64,
}

impl Storage {
    /// MAVLink asks for this, if for anything.
    pub(super) fn ask(&mut self, request: Option<Request>) {
        self.mavlink = request.or(self.mavlink);
    }

    /// The throttle wire asks for the parameters to be stored.
    pub(super) fn save(&mut self) {
        self.save = true;
    }

    /// At the start, with the time owed at the last save before it. How long the ESC was off is not known.
    pub(super) fn recall(&mut self, owed_s: u32) {
        self.owed_s = owed_s;
        self.refilled_us = (u64::from(owed_s) * 1_000_000).min(OWED_MAX_US + FIRST_SAVE_US);
    }

    /// The time owed at the last save, s.
    pub(super) fn owed_s(&self) -> u32 {
        self.owed_s
    }

    /// Something that is kept has changed.
    pub(super) fn changed(&mut self, now_us: u64) {
        let first_us = self.changes.map_or(now_us, |changes| changes.first_us);
        self.changes = Some(Changes {
            first_us,
            last_us: now_us,
        });
    }

    /// Settings were lost.
    pub(super) fn lose(&mut self) {
        self.lost = true;
    }

    /// Returns true if settings were lost, and none have been stored since.
    pub(super) fn is_lost(&self) -> bool {
        self.lost
    }

    /// Returns true if a reminder is due now.
    pub(super) fn reminds(&mut self, now_us: u64) -> bool {
        let due = self.lost && now_us.saturating_sub(self.reminded_us) >= REMIND_US;
        if due {
            self.reminded_us = now_us;
        }
        due
    }

    /// MAVLink asks for a restart, which waits until pending changes are stored.
    pub(super) fn reboot(&mut self) {
        self.reboot = true;
    }

    /// Returns true if a restart is due now.
    pub(super) fn reboots(&self) -> bool {
        // At the end of time all that waits is due.
        self.reboot && self.under_way.is_none() && self.next(u64::MAX).is_none()
    }

    /// Returns true if the restart waits for a save that is put off to spare the flash.
    pub(super) fn reboots_later(&self, now_us: u64) -> bool {
        self.next(now_us).is_none() && self.next(u64::MAX).is_some()
    }

    /// The restart begins, or is given up. Returns true if there was to be one.
    pub(super) fn cancel_reboot(&mut self) -> bool {
        core::mem::take(&mut self.reboot)
    }

    /// Returns true if a request waits, and none is under way.
    pub(super) fn waits(&self, now_us: u64) -> bool {
        self.under_way.is_none() && self.next(now_us).is_some()
    }

    fn next(&self, now_us: u64) -> Option<(Asker, Request)> {
        let is_due = |changes: Changes| {
            let quiet = self.reboot
                || now_us.saturating_sub(changes.last_us) >= QUIET_US
                || now_us.saturating_sub(changes.first_us) >= LATEST_US;
            quiet && self.refilled_us.saturating_sub(now_us) <= OWED_MAX_US
        };
        if let Some(request) = self.mavlink {
            Some((Asker::Mavlink, request))
        } else if self.save {
            Some((Asker::Wire, Request::Save))
        } else {
            // If settings were lost, the few that a companion sets at each start restore none of them.
            let due = !self.lost && self.changes.is_some_and(is_due);
            due.then_some((Asker::Nobody, Request::Keep))
        }
    }

    /// The next request, which is under way now.
    pub(super) fn take(&mut self, now_us: u64) -> Option<Request> {
        let (asker, request) = self.next(now_us)?;
        self.under_way = Some((asker, request));
        match asker {
            Asker::Mavlink => self.mavlink = None,
            Asker::Wire => self.save = false,
            Asker::Nobody => {
                self.refilled_us = self.refilled_us.max(now_us) + SAVE_EVERY_US;
                // By 64·15 625, in 32 bits: a day is 2^30.3 parts of 64 µs. A quotient of 64 bits is 900 bytes of code.
                self.owed_s = ((self.refilled_us - now_us) >> 6) as u32 / 15_625;
            }
        }
        if request != Request::Load {
            // All else is stored with it.
            self.changes = None;
        }
        Some(request)
    }

    /// Returns true if the flash now has all that is in force.
    pub(super) fn takes_all(&self) -> bool {
        self.under_way
            .is_some_and(|(_, request)| request != Request::Keep)
    }

    /// The request that was under way has ended; returns who must be told.
    pub(super) fn done(&mut self, well: bool) -> Option<Asker> {
        let (asker, request) = self.under_way.take()?;
        self.lost &= !well || request == Request::Load;
        let failed = core::mem::replace(&mut self.failed, !well && asker == Asker::Nobody);
        // Once is enough without a request.
        (asker != Asker::Nobody || (self.failed && !failed)).then_some(asker)
    }
}

/// A value that a command on the throttle wire has set, which is not stored until that is asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unstored {
    pub(super) id: ParamId,
    pub(super) value: f32,
    /// The value stored meanwhile.
    pub(super) stored: f32,
}

impl Unstored {
    /// Puts the value that is stored in the place of the one in force, if that is still this one.
    pub(super) fn hide(self, kept: &mut Kept) {
        if kept.params.get(self.id) == self.value {
            // It was in force once.
            let _ = kept.params.set(self.id, self.stored);
        }
    }
}

/// Carries out a request for storage, with the values of [`Esc::kept`](super::Esc::kept). Returns true if `kept` now has other
/// values, which shall be in force from now on: on the chip each copy takes 0.5 KB of stack.
///
/// # Errors
/// A few words on why the values would not survive a loss of power.
// Never inlined: its stack is free for what puts the values in force.
#[inline(never)]
pub fn obey<F: NorFlash>(
    request: Request,
    flash: &mut F,
    range: Range<u32>,
    kept: &mut Kept,
) -> Result<bool, &'static str> {
    match request {
        Request::Save | Request::Keep => {
            store::save(flash, range, kept).map_err(StoreError::text)?;
            Ok(false)
        }
        Request::Load => {
            let loaded = store::load(flash, range);
            match loaded.trouble() {
                Some(trouble) if loaded.integrity.is_lost() => Err(trouble),
                _ => {
                    kept.params = loaded.kept.params;
                    kept.intervals = loaded.kept.intervals;
                    Ok(true)
                }
            }
        }
        Request::FactoryReset => {
            *kept = Kept {
                statistics: kept.statistics,
                owed_s: kept.owed_s,
                ..Kept::default()
            };
            store::replace(flash, range, kept).map_err(StoreError::text)?;
            Ok(true)
        }
        Request::ParamsChanged | Request::Reboot => Ok(false),
    }
}
