//! The part of the drive's configuration that answers need.

use crate::drive::config::six_step;
use crate::drive::{ATTEMPTS, Fault, Snapshot};
use crate::params::{self, ParamId, Params};
use crate::units::{Current, Scale};

/// The little of a [`Config`](crate::drive::Config) that is needed to read a snapshot.
#[derive(Clone, Copy, Debug)]
pub struct Basis {
    /// The control's units in SI.
    pub scale: Scale,
    /// Bound of the current's vector, `LIM_PHASE_A`.
    pub(super) phase: Current,
    /// As [`Config::lost_periods`](crate::drive::Config::lost_periods).
    pub(super) lost_periods: u32,
}

impl Basis {
    /// Of the drive that these parameters make, whose units have this scale.
    pub fn new(params: &Params, scale: Scale) -> Self {
        Self {
            scale,
            phase: scale.current_from_a(params.get(ParamId::LimPhaseA)),
            lost_periods: params::lost_periods(&scale),
        }
    }

    /// Doubt of the rotor's position: 0 if all is well, 255 if the drive has given it up.
    ///
    /// It is the greatest share that has been used of what is allowed: of the attempts of a start,
    /// of the periods without an estimate, and of the six-step drive's sextants without a crossing.
    pub(super) fn doubt(&self, snapshot: &Snapshot) -> u8 {
        let faults = snapshot.faults;
        if faults.contains(Fault::ObserverLost) || faults.contains(Fault::Stuck) {
            return u8::MAX;
        }
        let share = |part: u32, whole: u32| part.min(whole) * u32::from(u8::MAX) / whole.max(1);
        share(snapshot.failed_starts.into(), ATTEMPTS as u32)
            .max(share(snapshot.lost_periods, self.lost_periods))
            .max(share(
                snapshot.missed_sextants.into(),
                six_step::LOST_SEXTANTS.into(),
            )) as u8
    }

    /// Returns true if the current's vector is within a sixteenth of its bound: the regulator holds it
    /// there within its ripple.
    pub(super) fn at_limit(&self, snapshot: &Snapshot) -> bool {
        let square = |bits: i32| i64::from(bits) * i64::from(bits);
        let bound = self.phase.to_bits();
        square(snapshot.i.d.to_bits()) + square(snapshot.i.q.to_bits())
            >= square(bound - bound / 16)
    }
}
