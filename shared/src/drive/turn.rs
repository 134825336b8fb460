//! A period in which the phases switch, and one in which the low sides are on.

use super::slow::{self, CYCLE};
use super::state::Seen;
use super::{Bridge, Config, Phase, Sample, State};
use crate::control::delay::Delay;
use crate::control::modulator::{self, Supply};
use crate::control::observer::{self, Input, Observer};
use crate::control::regulator::Regulator;
use crate::control::start;
use crate::control::transform::{
    self, AlphaBeta, Dq, Order, clarke_in, inverse_park, park, voltages,
};
use crate::math::{Held, TopProduct, sin_cos};
use crate::units::{AdcCounts, Current, Speed, Voltage, WideVoltage};

/// A period in which the phases switch, with this observer and this regulator.
#[inline(always)]
pub(super) fn period(
    (open_loop, delay): (bool, Delay),
    (observer, regulator): (&impl Observer, &impl Regulator),
    (config, state): (&Config, &mut State),
    (sample, currents): (&Sample, [AdcCounts; 3]),
) -> Bridge {
    let order = state.order;
    let stator = clarke_in(order, currents);
    let swapped = order == Order::SWAPPED;
    let input = input(delay, state, (sample, swapped), stator);
    let (frame, fb) = if open_loop {
        let imposed = Some(state.start.omega_s);
        if state.phase == Phase::Ramp || observer.follows_park() {
            observer.estimate(&mut state.observer, &input, imposed);
        }
        let theta = state.start.frame;
        let frame = sin_cos(theta);
        let i = park(stator, frame);
        state.seen.angle = order.angle(theta);
        state.seen.i = i;
        state.seen.speed = state.start.omega_s;
        let omega = start::advance(&mut state.start);
        let factor = state.inductance.factor;
        let fb = observer.feedback(&state.observer, (omega, i), factor);
        (frame, fb)
    } else {
        let estimate = observer.estimate(&mut state.observer, &input, None);
        let i = park(stator, estimate.frame);
        state.seen.angle = order.angle(estimate.theta);
        state.seen.speed = estimate.omega_bar;
        state.seen.i = i;
        let factor = state.inductance.factor;
        let fb = observer.feedback(&state.observer, (estimate.omega, i), factor);
        (estimate.frame, fb)
    };

    let asked = regulator.voltage(&state.regulator, &state.wanted, &fb);
    regulator.integrate(&mut state.regulator, &state.wanted, &fb);
    let square = modulator::square_of(asked);
    let u = if square <= state.supply.readable {
        modulator::short(asked)
    } else {
        long(regulator, state, asked)
    };
    observer.advance(&mut state.observer, &fb, u);
    state.seen.u = u;

    let v = inverse_park(transform::turn(u, state.ahead), frame);
    state.commanded = [voltages(v), state.commanded[0]];
    let certainty = inverse_park(state.certainty, frame);
    let dead_time = (&config.dead_time, certainty);
    let duties = modulator::duties(&config.modulator, &state.supply, (v, order), dead_time);
    state.applied[0] = duties;
    Bridge::Duty(duties)
}

/// A voltage vector so long that a phase cannot be read, or than the supply can give.
#[cold]
fn long(regulator: &impl Regulator, state: &mut State, asked: Dq<WideVoltage>) -> Dq<Voltage> {
    if state.unread == 0 {
        // Since then nobody has asked for them.
        state.applied[1] = state.applied[0];
    }
    state.unread = UNREAD;
    let (u, cut) = modulator::limit(asked, &state.supply.longest);
    if let Some(cut) = cut {
        regulator.give_way(&mut state.regulator, cut);
        state.missing = state.wanted.i.q.minus(state.seen.i.q);
    }
    u
}

/// Samples after a long vector in which its duties may still count.
const UNREAD: u8 = 3;

/// What the observer reads at this sample.
#[inline(always)]
fn input(
    delay: Delay,
    state: &State,
    (sample, swapped): (&Sample, bool),
    stator: AlphaBeta<Current>,
) -> Input {
    let [now, before] = state.commanded;
    Input {
        i: stator,
        v: AlphaBeta {
            alpha: delay.applied(now.alpha, before.alpha),
            beta: delay.applied(now.beta, before.beta),
        },
        inductance: state.inductance.factor,
        planned: state.planned,
        hall: hall(sample, swapped),
        swapped,
    }
}

/// The Hall sensors in the order of the control's phases.
pub(super) fn hall(sample: &Sample, swapped: bool) -> u8 {
    if swapped {
        sample.hall & 1 | (sample.hall & 2) << 1 | (sample.hall & 4) >> 1
    } else {
        sample.hall
    }
}

/// With the low sides on the voltage is known to be zero: the observer goes on, so that the speed
/// is reported down to where its back-EMF drowns in noise.
#[inline(never)]
pub(super) fn watch(
    observer: &impl Observer,
    (config, state): (&Config, &mut State),
    sample: &Sample,
    currents: [AdcCounts; 3],
) {
    state.turn = (state.turn + 1) % CYCLE as u8;
    let stator = clarke_in(state.order, currents);
    state.commanded = [AlphaBeta::default(), state.commanded[0]];
    let swapped = state.order == Order::SWAPPED;
    let input = input(config.delay, state, (sample, swapped), stator);
    let estimate = observer.estimate(&mut state.observer, &input, None);
    let i = park(stator, estimate.frame);
    let u = Dq::default();
    match state.turn {
        0 => {
            let factor = state.inductance.factor;
            observer::pace(&config.observer, &mut state.observer, factor, CYCLE);
        }
        // A drive may resume at any time.
        turn @ (4 | 8 | 12 | 16 | 20) => slow::begin(config, state, u32::from(turn) / 4),
        _ => {}
    }
    let factor = state.inductance.factor;
    let fb = observer.feedback(&state.observer, (estimate.omega, i), factor);
    observer.advance(&mut state.observer, &fb, u);
    // An eighth of the speed at which Run ends: 19 rpm with the defaults.
    let turns = estimate.omega_bar.to_bits() > config.slow.to_bits() >> 3;
    state.seen = Seen {
        phase: Phase::Brake,
        angle: state.order.angle(estimate.theta),
        speed: if turns {
            estimate.omega_bar
        } else {
            Speed::ZERO
        },
        i,
        u,
        bus_current: Current::ZERO,
    };
}

/// Phases b and c change places where the motor turns the other way than a, b, c.
#[inline(always)]
pub(super) fn in_order<T>(swapped: bool, [a, b, c]: [T; 3]) -> [T; 3] {
    if swapped { [a, c, b] } else { [a, b, c] }
}

/// A phase's reading as a current: one unit is 4096/3 counts.
pub(super) fn reading(counts: AdcCounts) -> Current {
    Current::from_bits(counts.to_bits().saturating_mul(3))
}

/// What the supply gives: 1.5·(v·i)/V_bus.
#[inline(always)]
pub(super) fn bus_current(u: Dq<Voltage>, i: Dq<Current>, supply: &Supply) -> Current {
    // 24 + 28 − 32 fraction bits; 28 wanted.
    let two_thirds: Current = (u.d.top(i.d) + u.q.top(i.q))
        .top(supply.reciprocal)
        .scaled();
    two_thirds + (two_thirds >> 1)
}
