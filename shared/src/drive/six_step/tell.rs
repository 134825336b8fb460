//! What telemetry hears of the six-step drive.

use fixed::types::I1F31;

use crate::control::six_step::commutation::SEXTANT;
use crate::control::transform::{Dq, clarke, park};
use crate::drive::state::Seen;
use crate::drive::{self, Phase};
use crate::math::{SinCos, TopProduct};
use crate::protection;
use crate::units::{AdcCounts, Current, Speed, Voltage};

/// 1/√3 with 31 fraction bits.
const RECIPROCAL_ROOT_3: I1F31 = I1F31::from_bits(1_239_850_263);

/// What telemetry hears, and what the supply's current does to the bounds.
pub(super) fn tell(
    config: &drive::Config,
    state: &mut drive::State,
    currents: [AdcCounts; 3],
    i: Current,
) {
    let s = &state.six_step;
    let duty = s.duty.duty;
    let bus_current = duty.top(i).scaled();
    protection::bound(
        &config.protection,
        &mut state.protection,
        (bus_current, i),
        1,
    );

    let parked = state.phase == Phase::Park;
    // In Park the rotor is taken to stand along the switching phase.
    let delta = if parked { SEXTANT } else { s.tracking.delta };
    let angle = s.sector.middle().wrapping_add(delta);
    let from_middle = SinCos::of(delta);
    let switched: Voltage = duty.top(state.protection.bus).scaled();
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
    protection::follow_limit(&config.protection, &mut state.protection, peak);
    let speed = match (parked, s.tracking.crossings) {
        (true, _) => Speed::ZERO,
        (false, 0) => s.tracking.omega,
        (false, _) => s.tracking.omega_bar,
    };
    state.seen = Seen {
        phase: state.phase,
        angle: if state.swapped(config) {
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
