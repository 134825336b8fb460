//! Telemetry of the six-step drive.

use fixed::types::I1F31;
use siskin_units::math::{SinCos, TopProduct};
use siskin_units::{AdcCounts, Angle, Current, Voltage};

use super::state::State;
use crate::control::PERIODS;
use crate::control::transform::{Dq, clarke, park};
use crate::drive::config::Config;
use crate::drive::phase::Phase;
use crate::drive::shared::Shared;
use crate::protection;

/// 1/√3 with 31 fraction bits.
const RECIPROCAL_ROOT_3: I1F31 = I1F31::from_bits(1_239_850_263);

/// Updates what telemetry needs of each period.
pub(super) fn update(
    config: &Config,
    (s, shared): (&State, &mut Shared),
    phase: Phase,
    currents: [AdcCounts; 3],
) {
    let seen = &mut shared.seen;
    seen.phase = phase;
    seen.speed = match s.tracking.crossings {
        0 => s.tracking.omega,
        _ => s.tracking.omega_bar,
    };
    if s.tracking.crossings > 0 && s.crossing.samples == 0 && s.missed == 0 {
        // The released phase's current died in the sextant that just ended, or no crossing would have been found.
        shared.shown = currents;
    }
    let angle = angle(s);
    shared.seen.angle = if shared.swapped(config) {
        angle.wrapping_neg()
    } else {
        angle
    };
}

/// Returns the rotor's angle.
fn angle(s: &State) -> Angle {
    s.sector.middle().wrapping_add(s.tracking.delta)
}

/// Updates the currents and voltages.
pub(super) fn see(s: &State, shared: &mut Shared, (currents, i): ([AdcCounts; 3], Current)) {
    let duty = s.duty.duty;
    let from_middle = SinCos::of(s.tracking.delta);
    let switched: Voltage = duty.top(shared.protection.bus).scaled();
    let along: Voltage = switched.top(RECIPROCAL_ROOT_3).scaled();
    let seen = &mut shared.seen;
    seen.u = Dq {
        d: along.top(from_middle.sin).scaled(),
        q: along.top(from_middle.cos).scaled(),
    };
    seen.i = park(clarke(currents), SinCos::of(angle(s)));
    seen.bus_current = duty.top(i).scaled();
}

/// Updates the bounds from the supply's current, and the trip level.
pub(super) fn supply(config: &Config, s: &State, shared: &mut Shared, i: Current) {
    let bus_current = s.duty.duty.top(i).scaled();
    let protection = &mut shared.protection;
    protection::bound(&config.protection, protection, (bus_current, i), PERIODS);
    let peak = Dq {
        d: Current::ZERO,
        q: s.duty.peak,
    };
    protection::follow_limit(&config.protection, protection, peak);
}
