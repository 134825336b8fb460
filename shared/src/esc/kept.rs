//! The values that survive a loss of power.

use siskin_params::ParamId;

use super::Esc;
use crate::mavlink::Warning;
use crate::record::Record;
use crate::store::{Kept, Loaded};

impl Esc {
    /// Restores stored values at power-up. The ESC was already created with the stored parameters.
    pub fn recall(&mut self, loaded: &Loaded) {
        let kept = &loaded.kept;
        self.component.keep_intervals(&kept.intervals);
        self.component.keep_signing(kept.signing);
        self.telemetry.statistics = kept.statistics;
        self.storage.recall(kept.owed_s);
        if loaded.integrity.is_lost() {
            self.lose_stored();
        }
        if let Some(trouble) = loaded.trouble() {
            self.warn_of(trouble);
        }
        if let Some(id) = self.params.lacking() {
            // The number of a choice has one digit.
            let number = char::from(b'0' + self.params.get(id) as u8);
            let mut warning = Warning::new();
            let _ = warning.push_str(id.entry().name);
            let _ = warning.push(' ');
            let _ = warning.push(number);
            let _ = warning.push_str(": not in this image");
            self.warn(warning);
        }
        if self.params.get(ParamId::MotPolePairs) == 0.0 {
            self.warn_of("MOT_POLE_PAIRS unknown: speeds assume 7");
        }
    }

    /// Serves the fault record that the interrupt writes.
    pub fn serve(&mut self, record: &'static Record) {
        self.record = Some(record);
    }

    /// Leaves the stored settings untouched because they are not in force, and keeps the motor off, until
    /// somebody asks for settings to be stored or reset.
    pub(super) fn lose_stored(&mut self) {
        self.storage.lose();
    }

    /// Returns the values to store now.
    // Never inlined: a copy takes 0.5 KB of the caller's stack.
    #[inline(never)]
    pub fn kept(&self) -> Kept {
        let mut kept = Kept {
            params: self.params.clone(),
            intervals: self.component.kept_intervals(),
            statistics: self.telemetry.statistics,
            signing: self.component.kept_signing(),
            owed_s: self.storage.owed_s(),
        };
        if !self.storage.takes_all() {
            for unstored in &self.unstored {
                unstored.hide(&mut kept);
            }
        }
        kept
    }

    /// Puts other values in force, as returned by [`obey`](super::obey); a [`Request::ParamsChanged`] follows, if they
    /// fit.
    ///
    /// [`Request::ParamsChanged`]: crate::mavlink::Request::ParamsChanged
    pub fn replace(&mut self, kept: &mut Kept) {
        kept.params.fit(&self.board);
        self.params = kept.params.clone();
        self.component.keep_intervals(&kept.intervals);
        if kept.signing.is_none() {
            self.component.forget_signing();
        }
        self.component.changed(&[]);
    }
}
