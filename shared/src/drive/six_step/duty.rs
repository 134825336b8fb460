//! The six-step drive's duty, from the demanded speed, current or share.

use fixed::types::I1F31;
use siskin_units::math::{Held, TopProduct};
use siskin_units::{AdcCounts, Current, Duty, Speed};

use super::state::{Piece, State};
use crate::control::planner;
use crate::control::six_step::commutation::Legs;
use crate::control::six_step::duty;
use crate::control::speed::Bounds;
use crate::drive::config::six_step::Config;
use crate::drive::config::{self, Stop};
use crate::drive::io::{Bridge, Setpoint, in_order};
use crate::drive::shared::Shared;

/// Largest reading that counts as no current: noise, and residual offset. On the bench 0.3 A are 20 rpm.
pub(super) const NO_CURRENT: AdcCounts = AdcCounts::lit("16");

/// Upper bound of the current for a shaft that must lose speed: one that certainly brakes.
const LEAST_BRAKING: Current = Current::from_bits(-3 * NO_CURRENT.to_bits());

/// Excess tolerated while the supply is near its maximum voltage: one part in this many of the demand.
const EXCESS_PART: i32 = 64;

/// The demand, relative to the direction of rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Demand {
    /// Nothing, or the other direction: stop.
    Rest,
    /// A speed above zero.
    Speed(Speed),
    /// A current, negative to brake.
    Current(Current),
    /// A share of the supply above zero.
    Share(I1F31),
}

/// Returns the set-point as seen along the rotation.
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

/// Returns true if a turning motor must stop.
pub(super) fn is_to_stop(setpoint: &Setpoint, reversed: bool) -> bool {
    demand(setpoint, reversed) == Demand::Rest
}

/// Returns the bounds, opened for braking if a speed, or a share of the supply, exceeds the demand; both in bits.
///
/// A current that reads as zero may be some mA, and an unloaded shaft gains speed from it. Braking takes that back
/// even where nothing may be returned to the supply: some tens of mA while the shaft is fast. A supply that sinks
/// no current at all is spared as its voltage nears the limit.
fn opened(
    config: &config::Config,
    shared: &Shared,
    bounds: Bounds,
    (present, wanted): (i32, i32),
) -> Bounds {
    let spared = shared.protection.bus >= config.protection.bus_return_v;
    let may_exceed = if spared { wanted / EXCESS_PART } else { 0 };
    let min = if present.saturating_sub(wanted) > may_exceed {
        bounds.min.min(LEAST_BRAKING)
    } else {
        bounds.min
    };
    Bounds { min, ..bounds }
}

/// Returns the greatest current whose ripple stays within the bound.
pub(super) fn most(s: &State, shared: &Shared) -> Current {
    let most = shared.protection.bounds.max;
    most.minus(s.duty.ripple()).max(most / 2)
}

/// Computes the duty in Run and Stopping.
pub(super) fn run(six_step: &Config, s: &mut State, i: Current) {
    let range = duty::range(&six_step.duty, &mut s.duty, i, s.bounds, s.most);
    duty::share(&six_step.duty, &mut s.duty, s.wanted, range);
}

/// Computes the wanted duty and the current's bounds in Run and Stopping.
#[inline(never)] // only some periods
pub(super) fn plan(
    config: &config::Config,
    six_step: &Config,
    (s, shared): (&mut State, &Shared),
    setpoint: &Setpoint,
) {
    let bounds = shared.protection.bounds;
    let bounds = Bounds {
        min: bounds.min.max(-six_step.braking),
        max: most(s, shared),
    };
    let speed = s.tracking.omega_bar;
    s.most = most_duty(six_step, s);
    let demand = demand(setpoint, shared.reversed);
    let mut slowest = speed;
    let (bounds, present, wanted) = match demand {
        Demand::Speed(command) => {
            let step = s.planner.plan(&six_step.planner, command);
            s.planner.advance(step);
            (bounds, speed.to_bits(), s.planner.reference.to_bits())
        }
        Demand::Share(share) => {
            let share = duty_of(six_step, share);
            (bounds, s.duty.duty.to_bits(), share.to_bits())
        }
        Demand::Current(current) => (only(bounds.hold(current)), 0, 0),
        Demand::Rest => {
            // The estimate's noise lowers it a little each time, so it comes to rest.
            slowest = s.planner.reference.min(speed);
            let bounds = match config.stop {
                Stop::Coast => only(Current::ZERO),
                Stop::Brake => bounds,
            };
            (bounds, speed.to_bits(), slowest.to_bits())
        }
    };
    // Once for all demands: in each of them it would cost 112 bytes more on the chip.
    s.bounds = opened(config, shared, bounds, (present, wanted));
    s.wanted = match demand {
        Demand::Speed(_) => {
            let error = s.planner.reference.saturating_sub(speed);
            s.wanted = duty::speed(&six_step.duty, &mut s.duty, (error, s.wanted));
            return;
        }
        Demand::Share(share) => duty_of(six_step, share),
        // Its bounds permit one duty only.
        Demand::Current(_) => s.duty.duty,
        Demand::Rest => I1F31::ZERO,
    };
    s.planner = planner::State::begin(slowest);
    duty::take_over(&mut s.duty);
}

/// log2 of the time constant, in periods of the outer loop, with which the duty settles that holds the fastest speed: 9 to
/// 21 ms.
const HOLD_SHIFT: u32 = 6;

/// Returns the largest duty: the whole where the motor is fast enough for its high sides' drivers, and less where it
/// would become too fast for the samples.
fn most_duty(six_step: &Config, s: &mut State) -> I1F31 {
    let speed = s.tracking.omega_bar;
    if !s.tracking.is_known() || speed < six_step.whole_from {
        return six_step.duty.duty_max;
    }
    let slower = six_step.fastest.saturating_sub(speed);
    let more = six_step.hold.held(slower);
    let held = s.held.saturating_add(more >> HOLD_SHIFT);
    s.held = held.max(I1F31::ZERO).min(six_step.whole);
    let most = s.held.saturating_add(more);
    most.max(I1F31::ZERO).min(six_step.whole)
}

/// Share from which the duty rises faster.
const FASTER_FROM: I1F31 = I1F31::lit("0.75");

/// Returns a share of the throttle as a duty: of the largest of a leg that switches, and at the end of the range the whole
/// that the board can read.
fn duty_of(six_step: &Config, share: I1F31) -> I1F31 {
    let switched = I1F31::from_bits(share.top(six_step.duty.duty_max).to_bits() << 1);
    let more = share.max(FASTER_FROM) - FASTER_FROM;
    // The last quarter of the throttle adds all that is left.
    let left = six_step.whole - six_step.duty.duty_max;
    switched.saturating_add(I1F31::from_bits(more.top(left).to_bits() << 3))
}

/// Returns bounds that permit only one current.
fn only(current: Current) -> Bounds {
    Bounds {
        min: current,
        max: current,
    }
}

/// Regulates the current.
pub(super) fn hold(six_step: &Config, s: &mut State, i: Current, wanted: Current) {
    let most = six_step.duty.duty_max;
    let range = duty::range(&six_step.duty, &mut s.duty, i, only(wanted), most);
    duty::share(&six_step.duty, &mut s.duty, range.greatest, range);
}

/// Starts speed regulation from the present speed and duty. Until the next demand these bounds hold.
pub(super) fn take_over(s: &mut State, bounds: Bounds) {
    s.planner = planner::State::begin(s.tracking.omega_bar);
    duty::take_over(&mut s.duty);
    s.wanted = s.duty.duty;
    s.bounds = bounds;
    s.most = s.duty.duty;
    s.held = duty::WHOLE;
    s.ask(Piece::Demand);
}

/// Returns the bridge in the present sextant.
pub(super) fn bridge(
    six_step: &Config,
    (s, shared): (&mut State, &mut Shared),
    swapped: bool,
) -> Bridge {
    let phases = s.sector.phases(Legs {
        switching: Some(s.duty.for_bridge(&six_step.duty)),
        low: Some(Duty::ZERO),
        floating: None,
    });
    let phases = in_order(swapped, phases);
    if s.duty.stays_high {
        shared.applied.expect_unreadable();
    }
    if shared.applied.may_matter() {
        shared
            .applied
            .command(phases.map(|duty| duty.unwrap_or(Duty::ZERO)));
    }
    s.were_high = s.were_high << 1 | u8::from(s.duty.stays_high);
    Bridge::Legs(phases)
}

#[cfg(test)]
mod tests {
    use siskin_params::{BOSSO_BENCH, Board, ParamId, Params, Shunts};

    use super::*;
    use crate::build::build;

    #[test]
    fn the_throttle_ends_where_the_duty_does_with_two_shunts_and_three() {
        for shunts in [Shunts::Two, Shunts::Three] {
            let board = Board {
                shunts,
                ..Board::BENCH
            };
            let mut params = Params::of(&BOSSO_BENCH);
            for (id, value) in [(ParamId::CtlDrive, 1.0), (ParamId::PwmFreqHz, 40_000.0)] {
                params.set(id, value).expect("in range");
            }
            let config = build(&params, &board).expect("it makes a drive");
            let six_step = config.six_step.as_ref().expect("chosen");
            let at = |share: f64| duty_of(six_step, I1F31::saturating_from_num(share));
            let steps = (0..=100).map(|percent| at(f64::from(percent) / 100.0));
            assert!(steps.clone().zip(steps.skip(1)).all(|(a, b)| a < b));
            let end = f64::from(at(1.0)) - f64::from(six_step.whole);
            assert!(end.abs() < 1e-6, "{shunts:?}: {end}");
        }
    }
}
