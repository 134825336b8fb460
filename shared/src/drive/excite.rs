//! Excitation of a standing motor's windings for measurement: a direct current along one phase's axis, with a
//! superimposed square-wave voltage with a cycle of four periods.
//!
//! Neither R nor L is known, so no regulator can be designed from them. The mean voltage rises by a small step in
//! each period in which the current is below the request, and falls in every other; the square wave's amplitude
//! does likewise, for a current of a quarter of the mean. This settles with any winding, and its ripple spreads the
//! duty over many timer counts, so the mean voltage is finer than one count.
//!
//! Throughout, each phase's voltage keeps the sign of its current: the dead time's effect is constant, and the
//! difference between two currents yields R without it.

use siskin_params::Delay;
use siskin_units::{AdcCounts, Angle, Current, Duty, Speed, Voltage, traced};

use super::config::Config;
use super::excitation::{Excitation, Ripple};
use super::io::Bridge;
use super::phase::Phase;
use super::seen::Seen;
use super::shared::Shared;
use crate::control::modulator;
use crate::control::transform::{AlphaBeta, Dq, clarke};

/// log2 of the supply voltage over a voltage's change per period.
const STEP_SHIFT: u32 = 15;

/// log2 of the means' time constant in periods: 21 ms at 24 kHz.
const MEAN_SHIFT: u32 = 9;

/// log2 of the mean current over the square wave's current.
const RIPPLE_SHIFT: u32 = 2;

traced! {
    /// The excitation under way.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub(super) struct State {
        phase: u8,
        ripple: Ripple,
        /// Position in the square wave's cycle, in periods.
        slot: u8,
        /// The mean voltage, and the square wave's amplitude.
        u: Voltage,
        h: Voltage,
        /// Mean of the phase currents' sum.
        sum: AdcCounts,
        /// Currents of the last two samples, along and across the axis.
        before: [AlphaBeta<Current>; 2],
        /// Means of the current and of the square wave's current.
        i: Current,
        response: Current,
        /// Means of the voltages.
        mean_u: Voltage,
        mean_h: Voltage,
    }
}

/// log2 of the trip level over the largest mean sum of the phase currents.
const SUM_SHIFT: u32 = 2;

/// log2 of the periods in that mean.
const SUM_MEAN_SHIFT: u32 = 5;

/// Returns false if the currents' sum shows that a sensor does not read its current: the voltage would rise until the
/// others trip, and a winding then carries twice their current. With two shunts there is no sum to compare: the third
/// current is computed from them.
pub(super) fn trusts(state: &mut State, trip: AdcCounts, currents: [AdcCounts; 3]) -> bool {
    let sum = currents
        .iter()
        .map(|current| current.to_bits())
        .sum::<i32>();
    state.sum += (AdcCounts::from_bits(sum) - state.sum) >> SUM_MEAN_SHIFT;
    state.sum.abs() <= trip >> SUM_SHIFT
}

/// Runs one period of an excitation. The snapshot's d current and voltage are the means along the axis, those of q
/// the square wave's amplitudes.
#[cold]
#[inline(never)] // only some periods
pub(super) fn period(
    config: &Config,
    (state, shared): (&mut State, &mut Shared),
    currents: [AdcCounts; 3],
    excitation: Excitation,
) -> Bridge {
    let (phase, ripple) = (excitation.phase(), excitation.ripple());
    if state.phase != phase {
        *state = State {
            phase,
            ..State::default()
        };
    }
    if state.ripple != ripple {
        state.ripple = ripple;
        state.h = Voltage::ZERO;
        state.response = Current::ZERO;
        state.mean_h = Voltage::ZERO;
    }
    let at = |behind: usize| (usize::from(phase) + behind) % 3;
    shared.supply.set_bus(shared.protection.bus);
    shared
        .supply
        .update_limits(&config.modulator, Voltage::ZERO);
    // Ordered from the excited phase on, so that Clarke's first component lies along its axis.
    let now = clarke([0, 1, 2].map(|behind| currents[at(behind)]));
    regulate(config, state, shared.supply.bus, now, excitation.current());
    shared.seen = Seen {
        phase: Phase::Tone,
        angle: Angle::ZERO,
        speed: Speed::ZERO,
        i: Dq {
            d: state.i,
            q: state.response,
        },
        u: Dq {
            d: state.mean_u,
            q: state.mean_h,
        },
        bus_current: Current::ZERO,
    };
    let h = if state.slot < 2 { state.h } else { -state.h };
    let (along, across) = match state.ripple {
        Ripple::None => (state.u, Voltage::ZERO),
        Ripple::Along => (state.u + h, Voltage::ZERO),
        Ripple::Across => (state.u, h),
    };
    let v = AlphaBeta {
        alpha: along.scaled(),
        beta: across.scaled(),
    };
    let turned = modulator::uncompensated(&config.modulator, &shared.supply, v);
    let mut duties = [Duty::ZERO; 3];
    for (behind, duty) in turned.into_iter().enumerate() {
        // The shortest periods leave less than half of the supply and the ripple take.
        duties[at(behind)] = duty.min(modulator::whole_duty(config.modulator.duty_max));
    }
    shared.applied.expect_unreadable();
    shared.applied.command(duties);
    Bridge::Duty(duties)
}

/// Updates the voltages for the next period.
fn regulate(
    config: &Config,
    state: &mut State,
    bus: Voltage,
    now: AlphaBeta<Current>,
    asked: Current,
) {
    let step = bus >> STEP_SHIFT;
    // Two periods ago the square wave's current was the opposite.
    let [last, earlier] = state.before;
    state.before = [now, last];
    let i = (now.alpha + earlier.alpha) >> 1;
    state.slot = (state.slot + 1) % 4;
    state.u = toward(state.u, i < asked, step, (bus >> 1) - (bus >> 3));
    state.i += (i - state.i) >> MEAN_SHIFT;
    state.mean_u += (state.u - state.mean_u) >> MEAN_SHIFT;
    // The voltage of slots 0 and 1 has raised the current in the sample after both, two slots after its last
    // command, or one if the voltage has no delay.
    let peak = 2 + u8::from(config.delay == Delay::One);
    let difference = match state.ripple {
        Ripple::None => return,
        Ripple::Along => now.alpha - earlier.alpha,
        Ripple::Across => now.beta - earlier.beta,
    };
    let response = match (state.slot + 4 - peak) % 4 {
        0 => difference >> 1,
        2 => -(difference >> 1),
        _ => return,
    };
    state.response += (response - state.response) >> (MEAN_SHIFT - 1);
    state.h = toward(state.h, response < asked >> RIPPLE_SHIFT, step, bus >> 3);
    state.mean_h += (state.h - state.mean_h) >> (MEAN_SHIFT - 1);
}

/// Returns the voltage one step up or down, between zero and the maximum.
fn toward(u: Voltage, up: bool, step: Voltage, most: Voltage) -> Voltage {
    if up {
        (u + step).min(most)
    } else {
        (u - step).max(Voltage::ZERO)
    }
}
