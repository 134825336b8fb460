//! Follows the motor's resistance and flux, and reports them.

use core::mem::MaybeUninit;

use super::Esc;
use crate::drive::{Config, Drift, Snapshot, Stated, put_default};
use crate::params::choice::{CtlAdaptL, CtlDrive, CtlObserver};
use crate::params::{Board, ParamId, Params, build_in};

/// Returns true if the drive can be built for a motor that has drifted so far. Never inlined: a configuration takes
/// 0.9 KB of stack.
#[inline(never)]
fn fits(params: &Params, board: &Board, drift: Drift) -> bool {
    let mut place = MaybeUninit::<Config>::uninit();
    build_in(params, board, drift, put_default(&mut place)).is_ok()
}

impl Esc {
    /// Looks at what the default observer shows of the motor, and has the configuration rebuilt if that has changed.
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
        if self.tracker.look(snapshot, stated) {
            self.reassumes = true;
            if !fits(&self.running(), &self.board, self.tracker.in_force()) {
                self.tracker.reject();
            }
        }
        let drift = self.tracker.drift();
        self.telemetry.r_mohm = r_mohm * drift.resistance;
        self.telemetry.flux_mwb = flux_mwb * drift.flux;
    }
}
