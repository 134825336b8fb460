//! The part of the drive's configuration that answers need.

use siskin_units::Scale;

use crate::build;
use crate::drive::config::six_step;
use crate::drive::{ATTEMPTS, Fault, Snapshot};

/// The parts of a [`Config`](crate::drive::Config) needed to interpret a snapshot.
#[derive(Clone, Copy, Debug)]
pub struct Basis {
    /// Converts the control's units to SI.
    pub scale: Scale,
    /// See [`Config::lost_periods`](crate::drive::Config::lost_periods).
    pub(super) lost_periods: u32,
}

impl Basis {
    /// Creates the basis of a drive with this scale.
    pub fn new(scale: Scale) -> Self {
        Self {
            scale,
            lost_periods: build::lost_periods(&scale),
        }
    }

    /// Returns how doubtful the rotor's position is: 0 if all is well, 255 if the drive has given it up.
    ///
    /// It is the largest used-up fraction of three allowances: start attempts, periods without an estimate,
    /// and, in six-step, sextants without a crossing.
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
}
