//! The six-step drive's duty: from the speed, the current or the share that is asked for.

use fixed::types::I1F31;

use super::state::State;
use crate::control::planner;
use crate::control::six_step::commutation::Legs;
use crate::control::six_step::duty;
use crate::control::speed::Bounds;
use crate::drive::config::six_step::Config;
use crate::drive::config::{self, Stop};
use crate::drive::io::{Bridge, Setpoint, in_order};
use crate::drive::seen::reading;
use crate::drive::shared::Shared;
use crate::math::{Held, TopProduct};
use crate::units::{AdcCounts, Current, Duty, Speed};

/// Readings up to which there is no current: noise, and what is left of an offset. On the bench 0.3 A
/// are 20 rpm.
pub(super) const NO_CURRENT: AdcCounts = AdcCounts::lit("16");

/// Speed that a shaft may gain while it is to stop, as a part of the least that it has had.
const GAINED_PART: i32 = 64;

/// The demand on a motor that turns the way it does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Demand {
    /// Nothing, or the other way: it is to be stopped.
    Rest,
    /// A speed above zero.
    Speed(Speed),
    /// A current, negative to brake.
    Current(Current),
    /// A share of the supply above zero.
    Share(I1F31),
}

/// The set-point as seen along the rotation.
fn demand(setpoint: &Setpoint, reversed: bool) -> Demand {
    let along = if reversed {
        setpoint.mirrored()
    } else {
        *setpoint
    };
    match along {
        Setpoint::Speed(speed) if speed > Speed::ZERO => Demand::Speed(speed),
        Setpoint::Voltage(share) if share > I1F31::ZERO => Demand::Share(share),
        Setpoint::Torque(current) | Setpoint::Test(current) => Demand::Current(current),
        _ => Demand::Rest,
    }
}

/// Returns true if a motor that turns the way it does is to be stopped.
pub(super) fn is_to_stop(setpoint: &Setpoint, reversed: bool) -> bool {
    demand(setpoint, reversed) == Demand::Rest
}

/// Run and Stopping: the duty.
pub(super) fn run(
    config: &config::Config,
    six_step: &Config,
    (s, shared): (&mut State, &Shared),
    i: Current,
    setpoint: &Setpoint,
) {
    let bounds = shared.protection.bounds;
    let bounds = Bounds {
        min: bounds.min.max(-six_step.braking),
        max: bounds.max.minus(s.duty.ripple()).max(bounds.max / 2),
    };
    match demand(setpoint, shared.reversed) {
        Demand::Speed(command) => {
            let step = s.planner.plan(&six_step.planner, command);
            s.planner.advance(step);
            let reference = s.planner.reference;
            let range = duty::range(&six_step.duty, &mut s.duty, i, bounds);
            let error = reference.saturating_sub(s.tracking.omega_bar);
            duty::speed(&six_step.duty, &mut s.duty, error, range);
            return;
        }
        Demand::Share(share) => {
            let range = duty::range(&six_step.duty, &mut s.duty, i, bounds);
            let share = I1F31::from_bits(share.top(six_step.duty.duty_max).to_bits() << 1);
            duty::share(&mut s.duty, share, range);
        }
        Demand::Current(current) => hold(six_step, s, i, bounds.hold(current)),
        Demand::Rest => {
            // A current of none is one of some mA: what a shaft without a load gains by it is taken
            // back.
            let slowest = s.planner.reference.min(s.tracking.omega_bar);
            let gained = s.tracking.omega_bar.saturating_sub(slowest) > slowest / GAINED_PART;
            let current = match config.stop {
                Stop::Coast => Current::ZERO,
                Stop::Brake => bounds.min,
            };
            let current = if gained {
                current.min(reading(NO_CURRENT).saturating_neg())
            } else {
                current
            };
            hold(six_step, s, i, current);
            s.planner = planner::State::begin(slowest);
            duty::take_over(&mut s.duty);
            return;
        }
    }
    s.planner = planner::State::begin(s.tracking.omega_bar);
    duty::take_over(&mut s.duty);
}

/// Regulates the current.
pub(super) fn hold(six_step: &Config, s: &mut State, i: Current, wanted: Current) {
    let bounds = Bounds {
        min: wanted,
        max: wanted,
    };
    let range = duty::range(&six_step.duty, &mut s.duty, i, bounds);
    duty::current(&mut s.duty, range);
}

/// Speed is regulated from the speed and the duty that there are.
pub(super) fn take_over(s: &mut State) {
    s.planner = planner::State::begin(s.tracking.omega_bar);
    duty::take_over(&mut s.duty);
}

/// The bridge of the present sextant.
pub(super) fn bridge(s: &State, swapped: bool, floating: Option<Duty>) -> Bridge {
    let phases = s.sector.phases(Legs {
        switching: Some(s.duty.for_bridge()),
        low: Some(Duty::ZERO),
        floating,
    });
    Bridge::Legs(in_order(swapped, phases))
}
