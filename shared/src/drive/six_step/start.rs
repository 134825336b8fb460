//! The start: Park, and another attempt if the rotor was not tracked.

use fixed::types::I36F28;

use super::duty::{bridge, hold};
use super::state::{FIRST_PARK, State};
use super::{outer, telemetry};
use crate::control::six_step::commutation::{Legs, Sector};
use crate::control::six_step::{crossing, tracking};
use crate::drive::config;
use crate::drive::config::six_step::Config;
use crate::drive::io::{Bridge, Setpoint, in_order};
use crate::drive::phase::Phase;
use crate::drive::seen::{greatest, reading};
use crate::drive::shared::Shared;
use crate::drive::transitions::Why;
use crate::protection::Fault;
use crate::units::{AdcCounts, Current, Duty};

/// Then along phase a, at 0°: a rotor opposite to c does not stay there.
const SECOND_PARK: Sector = Sector::Ac;

/// The ramp's first sextant, whose middle is 60° ahead of the rotor. Its phase rises, so a back-EMF too small to
/// see makes the crossing late, not missed.
const FIRST_RAMP: Sector = Sector::Ba;

/// Returns the current of Park and Ramp: half more after each failed start, up to the bound.
pub(super) fn current(six_step: &Config, shared: &Shared, setpoint: &Setpoint) -> Current {
    let more = |current: Current, _| current.saturating_add(current / 2);
    let current = (0..shared.failed_starts).fold(six_step.start_current, more);
    let current = current.min(shared.protection.bounds.max);
    match setpoint {
        Setpoint::Test(_) => current.min(six_step.test_current),
        _ => current,
    }
}

/// Holds the rotor along the switching leg's phase. The other two legs are both held low instead of one floating:
/// the current that the rotor's swing induces flows between them without dead time in its way, damps the swing and
/// shows its direction.
#[cold]
pub(super) fn park(
    config: &config::Config,
    six_step: &Config,
    (s, shared): (&mut State, &mut Shared),
    currents: [AdcCounts; 3],
    setpoint: &Setpoint,
) -> (Bridge, Option<Why>) {
    let wanted = current(six_step, shared, setpoint);
    let swapped = shared.swapped(config);
    let currents = in_order(swapped, currents);
    let [a, b, c] = [
        reading(currents[0]),
        reading(currents[1]),
        reading(currents[2]),
    ];
    let Legs {
        switching,
        low,
        floating,
    } = s.sector.legs([a, b, c]);
    // A swinging rotor drives a current through the other two, which may be the largest.
    hold(six_step, s, greatest([switching, low, floating]), wanted);
    // Counts at most the first attempt's current: a larger one damps the swing no sooner. Twice as long after a
    // failed start.
    s.charge += wanted.min(six_step.start_current).over_periods(1);
    let long = six_step.park_charge * (1 + i64::from(shared.failed_starts > 0));
    let mut is_aligned = false;
    if s.sector == FIRST_PARK {
        if s.charge >= long {
            s.charge = I36F28::ZERO;
            s.sector = SECOND_PARK;
        }
    } else {
        // Moving forwards along phase a, b has a positive back-EMF and c a negative one.
        let forwards = low.saturating_sub(floating).saturating_sub(s.swing);
        s.swing += forwards >> 6;
        let certain = wanted / 16;
        let was_forwards = s.swings_forwards;
        s.swings_forwards = s.swing
            > if s.swings_forwards {
                Current::ZERO
            } else {
                certain
            };
        let at_end = was_forwards && !s.swings_forwards && s.charge >= long * 2;
        is_aligned = at_end || s.charge >= long * 3;
    }
    let (phase, floating) = if is_aligned {
        s.sector = FIRST_RAMP;
        s.tracking = tracking::State::at_rest(six_step.ramp.apply(wanted));
        s.crossing = crossing::State::default();
        (Phase::Ramp, None)
    } else {
        (Phase::Park, Some(Duty::ZERO))
    };
    telemetry::update(config, (s, shared), phase, currents);
    let why = if is_aligned {
        Some(Why::Aligned)
    } else {
        let readings = (currents, switching);
        outer::run(config, six_step, (s, shared), setpoint, readings)
    };
    (bridge(s, swapped, floating), why)
}

/// Handles loss of synchronism: another start, or none. A motor that is being stopped loses nothing and coasts.
#[cold]
pub(super) fn lost(six_step: &Config, (s, shared): (&State, &mut Shared), phase: Phase) -> Why {
    let starting = phase == Phase::Ramp || s.tracking.omega_bar <= six_step.run_speed;
    if phase == Phase::Stopping {
        Why::Coasts
    } else if starting {
        shared.start_failed()
    } else {
        Why::Tripped(Fault::ObserverLost)
    }
}
