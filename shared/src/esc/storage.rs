//! Storage requests, one at a time, so that each result reaches whoever asked. Changes are stored unasked.

use core::ops::Range;

use embedded_storage::nor_flash::NorFlash;
use siskin_params::ParamId;

use crate::mavlink::Request;
use crate::store::{self, Kept, StoreError};

/// How long without a change before changes are stored, µs: a client that writes a whole parameter list wears
/// the flash once.
const QUIET_US: u64 = 1_000_000;
/// The longest wait while changes keep coming, µs, as long as unrequested saves are left ([`SAVES_AT_ONCE`]);
/// otherwise it is [`SAVE_EVERY_US`]. Signed frames heard meanwhile can be replayed after a loss of power.
const LATEST_US: u64 = 2_000_000;

/// Unrequested saves allowed in succession. An evening of trying one value after another takes as many.
const SAVES_AT_ONCE: u64 = 100;
/// The time that earns one more of them, µs. A client that keeps changing a value costs 100 + 480 of the
/// flash's 40 000 saves on its first day, 1.5 %.
const SAVE_EVERY_US: u64 = 180_000_000;
/// The longest wait for the first of them after a restart, µs, if all had been used up: changes survive when
/// the ESC is on for a minute. A client that changes a value and restarts the ESC all day costs 100 + 1440
/// saves, 3.9 %.
const FIRST_SAVE_US: u64 = 60_000_000;
/// The most that may be owed for one more save to be allowed, µs.
const OWED_MAX_US: u64 = (SAVES_AT_ONCE - 1) * SAVE_EVERY_US;

/// Time between two reminders of lost settings, µs: a station may have connected since.
const REMIND_US: u64 = 10_000_000;

/// Warns the user, and refuses to store anything else over lost settings.
pub(super) const LOST: &str = "Settings lost: set and store, or reset";

/// Who requested storage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Asker {
    /// A command or a calibration on the throttle wire.
    Wire,
    /// A MAVLink command, to be acknowledged.
    Mavlink,
    /// Nobody: something changed.
    Nobody,
}

/// When values to be stored changed.
#[derive(Clone, Copy, Debug)]
struct Changes {
    /// First change.
    first_us: u64,
    /// Last change.
    last_us: u64,
}

/// Waiting requests, and the one in progress.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Storage {
    /// MAVLink allows one at a time and refuses others.
    mavlink: Option<Request>,
    save: bool,
    /// Changes to be stored unasked.
    changes: Option<Changes>,
    /// When the full allowance of unrequested saves is available again.
    refilled_us: u64,
    /// The time left until then at the last of them, s, to be stored with it.
    owed_s: u32,
    /// Restart once nothing is waiting.
    reboot: bool,
    /// The request that the caller is carrying out, and its sender.
    under_way: Option<(Asker, Request)>,
    /// A failure to store changes has been reported.
    failed: bool,
    /// The stored settings cannot be in force: they stay, and nothing turns the motor, until somebody asks for
    /// settings to be stored or reset.
    lost: bool,
    /// When the last reminder was sent.
    reminded_us: u64,
}

impl Storage {
    /// Queues MAVLink's request, if there is one.
    pub(super) fn ask(&mut self, request: Option<Request>) {
        self.mavlink = request.or(self.mavlink);
    }

    /// Queues the throttle wire's request to store the parameters.
    pub(super) fn save(&mut self) {
        self.save = true;
    }

    /// Restores at power-up the time owed at the last save. How long the ESC was off is unknown.
    pub(super) fn recall(&mut self, owed_s: u32) {
        self.owed_s = owed_s;
        self.refilled_us = (u64::from(owed_s) * 1_000_000).min(OWED_MAX_US + FIRST_SAVE_US);
    }

    /// Returns the time owed at the last save, s.
    pub(super) fn owed_s(&self) -> u32 {
        self.owed_s
    }

    /// Records a change of a value that is kept.
    pub(super) fn changed(&mut self, now_us: u64) {
        let first_us = self.changes.map_or(now_us, |changes| changes.first_us);
        self.changes = Some(Changes {
            first_us,
            last_us: now_us,
        });
    }

    /// Records that settings were lost.
    pub(super) fn lose(&mut self) {
        self.lost = true;
    }

    /// Returns true if settings were lost and none have been stored since.
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

    /// Requests a restart for MAVLink, to wait until pending changes are stored.
    pub(super) fn reboot(&mut self) {
        self.reboot = true;
    }

    /// Returns true if a restart is due now.
    pub(super) fn reboots(&self) -> bool {
        // At the end of time everything that waits is due.
        self.reboot && self.under_way.is_none() && self.next(u64::MAX).is_none()
    }

    /// Returns true if the restart waits for a save that is postponed to spare the flash.
    pub(super) fn reboots_later(&self, now_us: u64) -> bool {
        self.next(now_us).is_none() && self.next(u64::MAX).is_some()
    }

    /// Clears the restart, as it begins or is abandoned. Returns true if one was requested.
    pub(super) fn cancel_reboot(&mut self) -> bool {
        core::mem::take(&mut self.reboot)
    }

    /// Returns true if a request waits and none is in progress.
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
            // After a loss, the few settings that a companion sets at each start do not restore the others.
            let due = !self.lost && self.changes.is_some_and(is_due);
            due.then_some((Asker::Nobody, Request::Keep))
        }
    }

    /// Takes the next request and marks it as in progress.
    pub(super) fn take(&mut self, now_us: u64) -> Option<Request> {
        let (asker, request) = self.next(now_us)?;
        self.under_way = Some((asker, request));
        match asker {
            Asker::Mavlink => self.mavlink = None,
            Asker::Wire => self.save = false,
            Asker::Nobody => {
                self.refilled_us = self.refilled_us.max(now_us) + SAVE_EVERY_US;
                // Divide by 64·15 625 in 32 bits: a day is 2^30.3 units of 64 µs. A 64-bit division is 900
                // bytes of code.
                self.owed_s = ((self.refilled_us - now_us) >> 6) as u32 / 15_625;
            }
        }
        if request != Request::Load {
            // The request stores all other changes too.
            self.changes = None;
        }
        Some(request)
    }

    /// Returns true if the request in progress stores everything that is in force.
    pub(super) fn takes_all(&self) -> bool {
        self.under_way
            .is_some_and(|(_, request)| request != Request::Keep)
    }

    /// Ends the request in progress; returns who must be told.
    pub(super) fn done(&mut self, well: bool) -> Option<Asker> {
        let (asker, request) = self.under_way.take()?;
        self.lost &= !well || request == Request::Load;
        let failed = core::mem::replace(&mut self.failed, !well && asker == Asker::Nobody);
        // Report an unrequested failure only once.
        (asker != Asker::Nobody || (self.failed && !failed)).then_some(asker)
    }
}

/// A value set by a command on the throttle wire, not stored until the wire asks for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unstored {
    pub(super) id: ParamId,
    pub(super) value: f32,
    /// The value stored meanwhile.
    pub(super) stored: f32,
}

impl Unstored {
    /// Substitutes the stored value if the command's is still in force.
    pub(super) fn hide(self, kept: &mut Kept) {
        if kept.params.get(self.id) == self.value {
            // It was in force once, so it is valid.
            let _ = kept.params.set(self.id, self.stored);
        }
    }
}

/// Carries out a storage request with the values of [`Esc::kept`](super::Esc::kept). Returns true if `kept` now
/// has other values, to be put in force; on the chip each copy takes 0.5 KB of stack.
///
/// # Errors
/// A short reason why the values would not survive a loss of power.
// Never inlined, so that its stack is free again for putting the values in force.
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
