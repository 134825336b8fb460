//! The drive's health, for the status and stress words of extended telemetry.
//!
//! The specification defines stress as the effort to keep commutating: 0 is perfect, full scale is impossible.
//! Here it is [`Basis::doubt`]: how close the drive is to giving the rotor up. Load is not part of it; the
//! current shows that.
//!
//! | event | raised by |
//! |---|---|
//! | alert | a [`Limit`](crate::drive::Limit) binds that leaves no more torque: the current is at `LIM_PHASE_A`, or the supply at `LIM_BUS_A` |
//! | warning | a start has failed and is being retried, the rotor's position is in doubt, or a phase or a sensor is at fault ([`Limits::warn`]) |
//! | error | a fault has turned the bridge off |
//!
//! The next status word reports an event once, and the ones after it repeat it while it lasts.

use siskin_throttle::answer::extended::{Extended, Status};

use super::Basis;
use crate::drive::{Limits, Snapshot};

/// The doubt that warrants a warning: a quarter of what is allowed, as one failed start of four. A crossing
/// that the current masks now and then stays below it.
const SUSPECT: u8 = 63;

/// Events since the last report.
#[derive(Clone, Debug, Default)]
pub(super) struct Health {
    status: Status,
    /// The maximum stress since the last stress word, and since the last status word.
    stress: u8,
    max_stress: u8,
    fault_count: u32,
}

impl Health {
    /// Takes in the drive's snapshot and the active limits, at each reply.
    pub(super) fn observe(&mut self, snapshot: &Snapshot, basis: &Basis, limits: Limits) {
        let doubt = basis.doubt(snapshot);
        self.stress = self.stress.max(doubt);
        self.max_stress = self.max_stress.max(doubt);
        let status = &mut self.status;
        status.alert |= limits.alert();
        status.warning |= doubt >= SUSPECT || limits.warn();
        status.error |= !snapshot.faults.is_empty() || snapshot.fault_count != self.fault_count;
        self.fault_count = snapshot.fault_count;
    }

    /// Forgets all events so far.
    pub(super) fn begin(&mut self) {
        *self = Self {
            fault_count: self.fault_count,
            ..Self::default()
        };
    }

    /// Returns the stress word and restarts its maximum.
    pub(super) fn stress(&mut self) -> Extended {
        Extended::Stress(core::mem::take(&mut self.stress))
    }

    /// Returns the status word and restarts its events.
    pub(super) fn status(&mut self) -> Extended {
        let status = Status {
            max_stress: core::mem::take(&mut self.max_stress) >> 4,
            ..core::mem::take(&mut self.status)
        };
        status.word()
    }
}

#[cfg(test)]
mod tests {
    use siskin_params::{BOSSO_MOTOR, Board, Params};

    use super::*;
    use crate::build::build;
    use crate::drive::{Fault, Limit, State};
    use crate::protection::Raised;

    fn rig() -> (Basis, Snapshot) {
        let config = build(&Params::of(&BOSSO_MOTOR), &Board::BENCH).expect("the defaults fit");
        let snapshot = State::new(&config).snapshot();
        (Basis::new(config.scale), snapshot)
    }

    fn status(health: &mut Health) -> Status {
        match health.status() {
            Extended::Status(value) => Status::from_value(value),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_drive_without_trouble_has_nothing_to_tell() {
        let (basis, snapshot) = rig();
        let mut health = Health::default();
        health.observe(&snapshot, &basis, Limits::NONE);
        assert_eq!(status(&mut health), Status::default());
        assert_eq!(health.stress(), Extended::Stress(0));
    }

    #[test]
    fn a_limit_is_told_once_as_what_it_is() {
        let (basis, calm) = rig();
        let mut health = Health::default();
        for limit in Limit::ALL {
            let mut limits = Limits::NONE;
            limits.insert(limit);
            health.observe(&calm, &basis, limits);
            health.observe(&calm, &basis, Limits::NONE);
            let told = status(&mut health);
            let raises = |status| limit.raises() == Some(status);
            let wanted = (raises(Raised::Alert), raises(Raised::Warning), false);
            assert_eq!((told.alert, told.warning, told.error), wanted, "{limit:?}");
            assert_eq!(status(&mut health), Status::default());
        }
    }

    #[test]
    fn failed_starts_are_stress_until_the_last_one_is_a_fault() {
        let (basis, calm) = rig();
        let mut health = Health::default();
        for (failed_starts, stress) in [(0, 0), (1, 63), (2, 127), (3, 191)] {
            let snapshot = Snapshot {
                failed_starts,
                ..calm
            };
            health.observe(&snapshot, &basis, Limits::NONE);
            assert_eq!(health.stress(), Extended::Stress(stress));
            let told = status(&mut health);
            assert_eq!(told.max_stress, stress >> 4);
            assert_eq!((told.warning, told.error), (failed_starts > 0, false));
        }
        let mut stuck = calm;
        stuck.faults.insert(Fault::Stuck);
        health.observe(&stuck, &basis, Limits::NONE);
        assert_eq!(health.stress(), Extended::Stress(255));
        let told = status(&mut health);
        assert!(told.warning && told.error);
    }

    #[test]
    fn a_position_that_is_in_doubt_is_stress() {
        let (basis, calm) = rig();
        let mut health = Health::default();
        let lost = Snapshot {
            lost_periods: basis.lost_periods / 2,
            ..calm
        };
        health.observe(&lost, &basis, Limits::NONE);
        health.observe(&calm, &basis, Limits::NONE);
        assert_eq!(health.stress(), Extended::Stress(127));
        assert_eq!(health.stress(), Extended::Stress(0), "it is over");
        assert_eq!(status(&mut health).max_stress, 7, "but was not told here");
    }

    fn after_a_fault(calm: Snapshot) -> Snapshot {
        Snapshot {
            fault_count: 1,
            ..calm
        }
    }

    #[test]
    fn a_fault_that_has_ended_before_anyone_asked_is_told_once() {
        let (basis, calm) = rig();
        let mut health = Health::default();
        let after = after_a_fault(calm);
        health.observe(&after, &basis, Limits::NONE);
        assert!(status(&mut health).error);
        health.observe(&after, &basis, Limits::NONE);
        assert!(!status(&mut health).error);
    }

    #[test]
    fn what_happened_before_the_beginning_is_not_told() {
        let (basis, calm) = rig();
        let mut health = Health::default();
        let after = after_a_fault(calm);
        health.observe(&after, &basis, Limits::NONE);
        health.begin();
        health.observe(&after, &basis, Limits::NONE);
        assert_eq!(status(&mut health), Status::default());
    }
}
