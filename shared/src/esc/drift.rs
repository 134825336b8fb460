//! The motor's resistance and flux as the ESC follows and tells them.

use super::Esc;
use crate::drive::{Snapshot, Stated};
use crate::params::ParamId;
use crate::params::choice::{CtlAdaptL, CtlDrive, CtlObserver};

impl Esc {
    /// Looks at what the default observer shows of the motor. The configuration is made anew where that has changed.
    pub(super) fn follow_motor(&mut self, snapshot: &Snapshot) {
        let params = &self.params;
        let shows = params.unknown().is_none()
            && !params.chosen(CtlDrive::SixStep)
            && params.chosen(CtlObserver::Compensated)
            // An inductance that is adapted is another than the one that is stated.
            && params.chosen(CtlAdaptL::Off)
            && !self.identify.is_under_way();
        let [r_mohm, l_uh, flux_mwb] =
            [ParamId::MotRMohm, ParamId::MotLUh, ParamId::MotFluxMwb].map(|id| params.get(id));
        let scale = &self.scale;
        let stated = if shows {
            Stated {
                drop: 1e-3 * r_mohm * scale.current_a / scale.voltage_v,
                own_flux: 1e-3 * l_uh * scale.current_a / flux_mwb,
            }
        } else {
            Stated::NONE
        };
        self.reassumes |= self.tracker.look(snapshot, stated);
        let drift = self.tracker.drift();
        self.telemetry.r_mohm = r_mohm * drift.resistance;
        self.telemetry.flux_mwb = flux_mwb * drift.flux;
    }
}
