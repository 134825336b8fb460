//! Warnings for the user.

use heapless::String;

/// A text composed at run time: what was tried, a parameter and a reason. Beyond 50 letters it takes two STATUSTEXTs.
pub type Warning = String<92>;

/// The pending warnings, at most two, and the last one for later readers.
#[derive(Clone, Debug)]
pub(super) struct Warnings {
    texts: [Warning; 2],
    /// Warnings received since all had been sent, and how many of those are sent.
    come: usize,
    sent: usize,
    /// The index of the last one.
    last: usize,
}

impl Warnings {
    pub(super) const fn new() -> Self {
        Self {
            texts: [const { Warning::new() }; 2],
            come: 0,
            sent: 0,
            last: 0,
        }
    }

    /// Queues a warning; of more than two at once, the first are kept.
    #[inline(never)] // five call it
    pub(super) fn push(&mut self, warning: Warning) {
        if let Some(place) = self.texts.get_mut(self.come) {
            *place = warning;
            self.last = self.come;
            self.come += 1;
        }
    }

    /// Returns the next one to send.
    pub(super) fn next(&mut self) -> Option<Warning> {
        if self.sent == self.come {
            self.come = 0;
            self.sent = 0;
            return None;
        }
        let next = self.texts.get(self.sent).cloned();
        self.sent += 1;
        next
    }

    /// Returns the last one received, sent or not; empty if there was none.
    pub(super) fn last(&self) -> &str {
        self.texts.get(self.last).map_or("", String::as_str)
    }
}
