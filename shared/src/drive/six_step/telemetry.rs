//! Telemetry of the six-step drive.

use fixed::types::I1F31;

use super::state::State;
use crate::control::six_step::commutation::SEXTANT;
use crate::control::transform::{Dq, clarke, park};
use crate::drive::config::Config;
use crate::drive::phase::Phase;
use crate::drive::seen::Seen;
use crate::drive::shared::Shared;
use crate::math::{SinCos, TopProduct};
use crate::protection;
use crate::units::{AdcCounts, Current, Speed, Voltage};

/// 1/√3 with 31 fraction bits.
const RECIPROCAL_ROOT_3: I1F31 = I1F31::from_bits(1_239_850_263);

/// Updates telemetry, and the bounds from the supply current.
pub(super) fn update(
    config: &Config,
    (s, shared): (&State, &mut Shared),
    phase: Phase,
    (currents, i): ([AdcCounts; 3], Current),
) {
    let duty = s.duty.duty;
    let bus_current = duty.top(i).scaled();
    protection::bound(
        &config.protection,
        &mut shared.protection,
        (bus_current, i),
        1,
    );

    let parked = phase == Phase::Park;
    // In Park the rotor is assumed to stand along the switching phase.
    let delta = if parked { SEXTANT } else { s.tracking.delta };
    let angle = s.sector.middle().wrapping_add(delta);
    let from_middle = SinCos::of(delta);
    let switched: Voltage = duty.top(shared.protection.bus).scaled();
    let along: Voltage = switched.top(RECIPROCAL_ROOT_3).scaled();
    let u = Dq {
        d: along.top(from_middle.sin).scaled(),
        q: along.top(from_middle.cos).scaled(),
    };
    let measured = park(clarke(currents), SinCos::of(angle));
    let peak = Dq {
        d: Current::ZERO,
        q: s.duty.peak,
    };
    protection::follow_limit(&config.protection, &mut shared.protection, peak);
    let speed = match (parked, s.tracking.crossings) {
        (true, _) => Speed::ZERO,
        (false, 0) => s.tracking.omega,
        (false, _) => s.tracking.omega_bar,
    };
    if s.tracking.crossings > 0 && s.crossing.samples == 0 && s.missed == 0 {
        // The released phase's current died in the sextant that just ended, or no crossing would have been found.
        shared.shown = currents;
    }
    shared.seen = Seen {
        phase,
        angle: if shared.swapped(config) {
            angle.wrapping_neg()
        } else {
            angle
        },
        speed,
        i: measured,
        u,
        bus_current,
    };
}
