//! The windings of a rotor that stands are excited to be measured: a direct current along a phase's axis, and
//! about it a square wave of voltage with a cycle of four periods.
//!
//! Neither R nor L is known, so nothing is regulated by them. The mean voltage goes up by a small step in each
//! period in which the current is below what is asked for, and down in each other one; the square wave's
//! amplitude does likewise, for a current of a quarter of the mean. That settles with any winding, and what it
//! swings by takes the duty over many counts of the timer, so that the mean of the voltage is finer than one.
//!
//! The voltage of each phase keeps the sign of its current all the while: what the dead time takes is constant,
//! and the difference of two currents tells R without it.

use super::config::Config;
use super::excitation::{Excitation, Ripple};
use super::io::Bridge;
use super::phase::Phase;
use super::seen::Seen;
use super::shared::Shared;
use crate::control::dead_time;
use crate::control::delay::Delay;
use crate::control::modulator;
use crate::control::transform::{AlphaBeta, Dq, PhaseOrder, clarke};
use crate::trace::traced;
use crate::units::{AdcCounts, Angle, Current, Duty, Speed, Voltage};

/// The share of the supply by which a voltage changes in a period, as a power of two.
const STEP_SHIFT: u32 = 15;

/// Time constant of the means, periods, as a power of two: 21 ms at 24 kHz.
const MEAN_SHIFT: u32 = 9;

/// The square wave's current, of the mean current, as a power of two.
const RIPPLE_SHIFT: u32 = 2;

traced! {
    /// The excitation under way.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub(super) struct State {
        phase: u8,
        ripple: Ripple,
        /// The period of the square wave's cycle.
        slot: u8,
        /// The mean voltage, and the square wave's amplitude.
        u: Voltage,
        h: Voltage,
        /// Currents of the last two samples, along the axis and across it.
        before: [AlphaBeta<Current>; 2],
        /// Means of the current and of the square wave's current.
        i: Current,
        response: Current,
        /// Means of the voltages.
        mean_u: Voltage,
        mean_h: Voltage,
    }
}

/// A period of an excitation. The snapshot's current and voltage along d are the means along the axis, those
/// along q the amplitudes of the square wave.
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
    shared.supply.follow(shared.protection.bus);
    shared.supply.reach(&config.modulator, Voltage::ZERO);
    // In the order from the excited phase on, along whose axis Clarke's first component is.
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
    let none = (&dead_time::Config::NONE, AlphaBeta::default());
    let v = (v, PhaseOrder::NORMAL);
    let turned = modulator::duties(&config.modulator, &shared.supply, v, none);
    let mut duties = [Duty::ZERO; 3];
    for (behind, duty) in turned.into_iter().enumerate() {
        duties[at(behind)] = duty;
    }
    shared.applied.expect_unreadable();
    shared.applied.command(duties);
    Bridge::Duty(duties)
}

/// The voltages of the coming period.
fn regulate(
    config: &Config,
    state: &mut State,
    bus: Voltage,
    now: AlphaBeta<Current>,
    asked: Current,
) {
    let step = bus >> STEP_SHIFT;
    // The square wave's current two periods ago was the opposite one.
    let [last, earlier] = state.before;
    state.before = [now, last];
    let i = (now.alpha + earlier.alpha) >> 1;
    state.slot = (state.slot + 1) % 4;
    state.u = toward(state.u, i < asked, step, (bus >> 1) - (bus >> 3));
    state.i += (i - state.i) >> MEAN_SHIFT;
    state.mean_u += (state.u - state.mean_u) >> MEAN_SHIFT;
    // A voltage of the slots 0 and 1 has raised the current in the sample that follows both, two slots after
    // its last command, or one without a delay of the voltage.
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

/// A step up or down between zero and the most.
fn toward(u: Voltage, up: bool, step: Voltage, most: Voltage) -> Voltage {
    if up {
        (u + step).min(most)
    } else {
        (u - step).max(Voltage::ZERO)
    }
}
