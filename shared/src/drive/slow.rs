//! What need not be done in every period while the phases switch: one piece of it a period, in turns,
//! and none in every other period.
//!
//! The speed regulator so acts three thousand times a second at 24 kHz, for a bandwidth of tens of
//! hertz, and the dead time's compensation follows it; what follows the supply does so half as often, and
//! what follows the speed half as often as that. Two periods in three have no slow work.

use super::turn::bus_current;
use super::{Config, Phase, Setpoint, State, launch};
use crate::control::dead_time;
use crate::control::observer;
use crate::control::regulator::Reference;
use crate::control::speed::{self, Bounds};
use crate::control::{PERIODS, torque, voltage};
use crate::math::{Held, sin_cos};
use crate::protection;
use crate::units::{Current, Speed};

/// Periods until every piece has had its turn: four times the outer loops' period.
pub(super) const CYCLE: u32 = 4 * PERIODS;

/// Periods from one look at the supply to the next: one that takes nothing back rises by volts a
/// millisecond.
const SUPPLY_PERIODS: u32 = 2 * PERIODS;

/// This period's piece.
#[inline(always)]
pub(super) fn turn(config: &Config, state: &mut State, setpoint: &Setpoint) {
    state.turn = (state.turn + 1) % CYCLE as u8;
    match state.turn {
        0 | 8 | 16 | 24 => reference(config, state, setpoint),
        2 | 18 => {
            sign(config, state);
            supply(state);
            if !state.phase.is_open_loop() {
                reach(config, state);
            }
        }
        4 => pace(config, state),
        6 | 22 => {
            limit(config, state);
            bounds(config, state);
            if !state.phase.is_open_loop() {
                share(config, state);
            }
        }
        10 => supervise(config, state, setpoint),
        26 => proceed(config, state),
        _ => {}
    }
}

/// What a drive that begins must know before its first period, in five pieces.
pub(super) fn begin(config: &Config, state: &mut State, n: u32) {
    match n {
        1 => {
            limit(config, state);
            supply(state);
        }
        2 => reach(config, state),
        3 => bounds(config, state),
        4 => share(config, state),
        _ => {
            aim(config, state);
            sign(config, state);
        }
    }
}

/// The drive's phase, as the set-point asks for it, and where the voltage is aimed.
#[inline(never)]
fn supervise(config: &Config, state: &mut State, setpoint: &Setpoint) {
    aim(config, state);
    sign(config, state);
    launch::follow(config, state, *setpoint);
    state.seen.phase = state.phase;
}

/// The drive's phase, as the rotor allows it, and what crosses between the regulator's axes at this
/// speed.
#[inline(never)]
fn proceed(config: &Config, state: &mut State) {
    let before = state.phase;
    state.lost_periods = if state.observer.told.lost && !state.phase.is_open_loop() {
        state.lost_periods + CYCLE
    } else {
        0
    };
    if let Some(fault) = launch::proceed(config, state) {
        state.trip(fault);
    }
    state.seen.phase = state.phase;
    if state.phase == before {
        // One that is handed over has begun with what crosses, and has no reference of its own yet.
        sign(config, state);
        cross(config, state);
    }
}

/// The trip follows its limit.
#[inline(always)]
fn limit(config: &Config, state: &mut State) {
    protection::follow_limit(&config.protection, &mut state.protection, state.seen.i);
}

/// What the supply gives.
#[inline(never)]
fn supply(state: &mut State) {
    state.supply.follow(state.protection.bus);
    state.seen.bus_current = bus_current(state.seen.u, state.seen.i, &state.supply);
}

/// What its voltage is enough for. The current that a start imposes takes little of it, and is bounded
/// by the supply alone: it needs neither this nor the speed's [`share`].
#[inline(never)]
fn reach(config: &Config, state: &mut State) {
    state.supply.reach(&config.modulator, state.seen.u.d);
}

/// What the supply's current does to the bounds of i_q.
#[inline(never)]
fn bounds(config: &Config, state: &mut State) {
    let seen = &state.seen;
    protection::bound(
        &config.protection,
        &mut state.protection,
        (seen.bus_current, seen.i.q),
        SUPPLY_PERIODS,
    );
    // What is wanted next follows from that; a bound that braking has reached does not wait for it:
    // where the supply takes nothing its voltage rises by volts a millisecond.
    state.wanted.i.q = state.wanted.i.q.max(state.protection.bounds.min);
}

/// What the speed leaves of them, and i_d.
#[inline(never)]
fn share(config: &Config, state: &mut State) {
    let bounds = state.protection.bounds;
    (state.i_d, state.bounds) = config.low_speed.bounds(bounds, state.seen.speed);
}

/// Run and Stopping: the current reference.
#[inline(never)]
fn reference(config: &Config, state: &mut State, setpoint: &Setpoint) {
    // The first period of a drive comes by here.
    state.seen.phase = state.phase;
    if state.phase.is_open_loop() {
        return;
    }
    let setpoint = if state.reversed {
        setpoint.turned()
    } else {
        *setpoint
    };
    let missing = core::mem::take(&mut state.missing);
    let (command, bounds) = match (state.phase, setpoint) {
        (Phase::Run, Setpoint::Speed(command)) => (command, state.bounds),
        (Phase::Run, Setpoint::Torque(i_q) | Setpoint::Test(i_q)) => {
            return directly(config, state, Reference::steady(i_q));
        }
        (Phase::Run, Setpoint::Voltage(share)) => {
            return directly(config, state, at_voltage(config, state, share));
        }
        // Stopping, and turning round, is by regenerative braking.
        _ => {
            let braking = Bounds {
                max: Current::ZERO,
                ..state.bounds
            };
            (Speed::ZERO, braking)
        }
    };
    let input = speed::Input {
        command,
        speed: state.seen.speed,
        told: state.observer.told,
        bounds,
        missing,
    };
    let before = state.speed.reference();
    let wanted = config.speed.current(&mut state.speed, &input);
    state.planned = state.speed.reference().minus(before) / PERIODS as i32;
    state.wanted = torque::grow(&config.torque, &mut state.torque, wanted).with_i_d(state.i_d);
}

/// The current at which a share of the voltage is given.
#[cold]
fn at_voltage(config: &Config, state: &State, share: fixed::types::I1F31) -> Reference {
    let u_q = voltage::of_share(share, state.supply.longest.length());
    let frame = (state.seen.speed, state.seen.i);
    let factor = state.inductance.factor;
    let fb = observer::feedback(&config.observer, &state.observer, frame, factor);
    voltage::reference(&config.regulator, &state.regulator, &fb, state.i_d, u_q)
}

/// A current that is commanded, while the speed regulator stands by to take over.
#[cold]
fn directly(config: &Config, state: &mut State, wanted: Reference) {
    let wanted = torque::follow(&config.torque, &mut state.torque, wanted, state.bounds);
    config
        .speed
        .begin(&mut state.speed, state.seen.speed, wanted.i.q);
    state.planned = Speed::ZERO;
    state.wanted = wanted.with_i_d(state.i_d);
}

/// The voltage acts from `delay` to `delay + 1` periods after the sample, while the rotor turns on:
/// aimed at the middle of that time. Without this the loop is unstable above 4489 rpm on the bench
/// at 15 kHz.
#[inline(always)]
fn aim(config: &Config, state: &mut State) {
    state.ahead = sin_cos(config.delay.advance(state.seen.speed));
}

/// Which way the phases' currents go, for the dead time: two periods behind each reference. Where
/// braking begins i_q* passes zero at 3 A/ms on the bench: once a cycle the sign would be wrong for a
/// millisecond, after which the adaptive back-EMF observer as published swings by 45°.
#[inline(never)]
fn sign(config: &Config, state: &mut State) {
    state.certainty = dead_time::certainty(&config.dead_time, state.wanted.i, state.ahead);
}

/// The observer's coefficients that follow the speed.
#[inline(never)]
fn pace(config: &Config, state: &mut State) {
    let factor = state.inductance.factor;
    observer::pace(&config.observer, &mut state.observer, factor, CYCLE);
}

/// The regulator's.
#[inline(always)]
fn cross(config: &Config, state: &mut State) {
    let factor = state.inductance.factor;
    config
        .regulator
        .pace(&mut state.regulator, state.seen.speed, factor);
}
