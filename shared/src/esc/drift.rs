//! Follows the motor's resistance and flux, and reports them.

use siskin_params::ParamId;
use siskin_params::choice::{CtlAdaptL, CtlDrive, CtlObserver};

use super::Esc;
use super::fit::check_drifted;
use crate::drive::{Snapshot, Stated};

impl Esc {
    /// Takes in what the default observer shows of the motor, and has the configuration rebuilt if that has changed.
    pub(super) fn follow_motor(&mut self, snapshot: &Snapshot) {
        let params = &self.params;
        let shows = params.unknown().is_none()
            && !params.chosen(CtlDrive::SixStep)
            && params.chosen(CtlObserver::Compensated)
            // An adapted inductance differs from the stated one.
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
        if self.tracker.update(snapshot, stated) {
            self.motor_reassumed = true;
            let drift = self.tracker.in_force();
            if check_drifted(&self.running(), &self.board, drift).is_err() {
                self.tracker.reject();
            }
        }
        let drift = self.tracker.drift();
        self.telemetry.r_mohm = r_mohm * drift.resistance;
        self.telemetry.flux_mwb = flux_mwb * drift.flux;
    }
}
