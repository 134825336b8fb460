//! Requests for storage, one at a time: how each ends must reach the one who asked.

use crate::mavlink::Request;

/// Who has asked for storage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Asker {
    /// A command or a calibration on the throttle wire.
    Wire,
    /// A MAVLink command, which is acknowledged.
    Mavlink,
}

/// What waits, and what is under way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Storage {
    /// MAVLink has one at a time, and refuses others.
    mavlink: Option<Request>,
    save: bool,
    /// Whose request the caller has been given.
    under_way: Option<Asker>,
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

    /// Whether a request waits, and none is under way.
    pub(super) fn waits(&self) -> bool {
        self.under_way.is_none() && (self.mavlink.is_some() || self.save)
    }

    /// The next request, which is under way now.
    pub(super) fn take(&mut self) -> Option<Request> {
        if let Some(request) = self.mavlink.take() {
            self.under_way = Some(Asker::Mavlink);
            return Some(request);
        }
        core::mem::take(&mut self.save).then(|| {
            self.under_way = Some(Asker::Wire);
            Request::Save
        })
    }

    /// The request that was under way has ended: whose it was.
    pub(super) fn done(&mut self) -> Option<Asker> {
        self.under_way.take()
    }
}
