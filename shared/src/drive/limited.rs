//! Which limits are active, from a snapshot. Runs in the tasks, not the interrupt.

use siskin_units::{Current, Speed, Voltage};

use super::snapshot::Snapshot;
use crate::protection::{Limit, Limits};

/// Thresholds at which limits count as active, in the control's units.
#[derive(Clone, Copy, Debug)]
pub struct Thresholds {
    /// Bound on the current vector, `LIM_PHASE_A`.
    pub phase: Current,
    /// Supply voltage above which less is returned, as
    /// [`Config::bus_return_v`](crate::protection::Config::bus_return_v).
    pub bus_return_v: Voltage,
    /// Supply voltage below which less is drawn.
    pub bus_draw_v: Voltage,
    /// Fastest speed that the six-step drive follows; with the other drive the greatest of the type.
    pub fastest: Speed,
}

/// A quantity at its bound lies within a sixteenth of it: the regulator's ripple is smaller.
const NEAR_SHIFT: u32 = 4;

/// A speed that is held wavers by a percent: within a sixty-fourth it is.
const HELD_SHIFT: u32 = 6;

impl Thresholds {
    /// Returns the limits that are active now.
    pub fn limits(&self, snapshot: &Snapshot) -> Limits {
        let mut limits = Limits::NONE;
        if !snapshot.phase.drives() {
            return limits;
        }
        let mut note = |binds: bool, limit| {
            if binds {
                limits.insert(limit);
            }
        };
        let (i, u, bounds) = (snapshot.i, snapshot.u, snapshot.bounds);
        note(
            reaches(i.d.to_bits(), i.q.to_bits(), near(self.phase).to_bits()),
            Limit::PhaseCurrent,
        );
        let draws_less = bounds.max < self.phase;
        let sags = snapshot.bus < self.bus_draw_v;
        note(
            draws_less && !sags && i.q >= near(bounds.max),
            Limit::BusCurrent,
        );
        // The bound may be zero, and the current as much as its noise below it.
        note(
            draws_less && sags && i.q >= bounds.max - (self.phase >> NEAR_SHIFT),
            Limit::SupplySag,
        );
        // There is a bound even without braking, ready but far from the current.
        note(
            i.q.is_negative() && bounds.min > -self.phase && i.q <= near(bounds.min),
            Limit::RegenCurrent,
        );
        note(snapshot.bus > self.bus_return_v, Limit::BusVoltage);
        note(
            snapshot.speed.saturating_abs() >= self.fastest - (self.fastest >> HELD_SHIFT),
            Limit::CommutationRate,
        );
        // The longest voltage without over-modulation is 1/√3 of the supply; 1/2 + 1/16 is 3 % less.
        let bus = snapshot.bus;
        let most = (bus >> 1) + (bus >> NEAR_SHIFT);
        note(
            reaches(u.d.to_bits(), u.q.to_bits(), (most - (most >> 5)).to_bits()),
            Limit::Duty,
        );
        limits
    }
}

/// Returns true if a vector reaches a bound, by squares to avoid a root.
///
/// Never inlined: it has two callers.
#[inline(never)]
fn reaches(d: i32, q: i32, bound: i32) -> bool {
    let square = |bits: i32| i64::from(bits) * i64::from(bits);
    square(d) + square(q) >= square(bound)
}

fn near(bound: Current) -> Current {
    bound - (bound >> NEAR_SHIFT)
}

#[cfg(test)]
mod tests {
    use siskin_params::{BOSSO_BENCH, Board, Params};

    use super::*;
    use crate::build::build;
    use crate::control::speed::Bounds;
    use crate::drive::{Phase, State};

    fn at(share_d: f64, share_q: f64) -> (Thresholds, Snapshot) {
        let config = build(&Params::of(&BOSSO_BENCH), &Board::BENCH).expect("the defaults fit");
        let protection = &config.protection;
        let mut snapshot = State::new(&config).snapshot();
        let share = |share: f64| Current::from_num(protection.phase.to_num::<f64>() * share);
        snapshot.phase = Phase::Run;
        snapshot.bounds = Bounds {
            min: -protection.phase,
            max: protection.phase,
        };
        snapshot.bus = protection.bus_return_v / 2;
        snapshot.i.d = share(share_d);
        snapshot.i.q = share(share_q);
        let thresholds = Thresholds {
            phase: protection.phase,
            bus_return_v: protection.bus_return_v,
            bus_draw_v: protection.bus_draw_v,
            fastest: Speed::MAX,
        };
        (thresholds, snapshot)
    }

    fn only(limits: Limits, wanted: Option<Limit>) {
        assert!(limits.iter().eq(wanted), "{limits:?} for {wanted:?}");
    }

    #[test]
    fn the_length_of_the_current_counts_and_nothing_binds_at_rest() {
        for (d, q, binds) in [(0.0, 0.9, false), (0.0, -0.97, true), (0.7, 0.7, true)] {
            let (thresholds, mut snapshot) = at(d, q);
            only(
                thresholds.limits(&snapshot),
                binds.then_some(Limit::PhaseCurrent),
            );
            snapshot.phase = Phase::Idle;
            only(thresholds.limits(&snapshot), None);
        }
    }

    #[test]
    fn a_bound_that_the_supply_has_moved_binds_where_the_current_is_at_it() {
        for (q, max, min, wanted) in [
            (0.5, 0.5, -1.0, Some(Limit::BusCurrent)),
            (0.3, 0.5, -1.0, None),
            (-0.25, 1.0, -0.25, Some(Limit::RegenCurrent)),
            (-0.1, 1.0, -0.25, None),
            (0.3, 1.0, -0.25, None),
        ] {
            let (thresholds, mut snapshot) = at(0.0, q);
            let share = |share: f64| Current::from_num(thresholds.phase.to_num::<f64>() * share);
            snapshot.bounds = Bounds {
                min: share(min),
                max: share(max),
            };
            only(thresholds.limits(&snapshot), wanted);
        }
    }

    #[test]
    fn the_supply_binds_near_its_limit_and_where_it_is_used_up() {
        let (thresholds, mut snapshot) = at(0.0, 0.5);
        snapshot.u.q = Voltage::from_num(snapshot.bus.to_num::<f64>() / 3.0_f64.sqrt() * 0.97);
        only(thresholds.limits(&snapshot), Some(Limit::Duty));
        snapshot.bus = thresholds.bus_return_v + Voltage::DELTA;
        only(thresholds.limits(&snapshot), Some(Limit::BusVoltage));
    }

    #[test]
    fn a_motor_at_the_fastest_speed_that_six_step_follows_is_held() {
        for (share, wanted) in [(0.97, None), (0.99, Some(Limit::CommutationRate))] {
            let (mut thresholds, mut snapshot) = at(0.0, 0.5);
            thresholds.fastest = Speed::from_num(0.05);
            for direction in [1.0, -1.0] {
                snapshot.speed = Speed::from_num(0.05 * share * direction);
                only(thresholds.limits(&snapshot), wanted);
            }
        }
    }

    /// A bound of zero binds too: the motor is asked to turn, and the supply does not let it.
    #[test]
    fn a_supply_that_sags_binds_and_not_its_current() {
        for (q, max, wanted) in [
            (0.5, 0.5, Some(Limit::SupplySag)),
            (-0.01, 0.0, Some(Limit::SupplySag)),
            (0.3, 0.5, None),
            (0.5, 1.0, None),
        ] {
            let (thresholds, mut snapshot) = at(0.0, q);
            snapshot.bus = thresholds.bus_draw_v - Voltage::DELTA;
            snapshot.bounds.max = Current::from_num(thresholds.phase.to_num::<f64>() * max);
            only(thresholds.limits(&snapshot), wanted);
        }
    }
}
