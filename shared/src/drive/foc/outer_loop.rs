//! The pieces of outer-loop work.

use super::state::State;
use crate::control::regulator::Reference;
use crate::control::speed::{self, Bounds};
use crate::control::{PERIODS, dead_time, observer, torque, voltage};
use crate::drive::config::Config;
use crate::drive::io::Setpoint;
use crate::drive::phase::Phase;
use crate::drive::schedule::{CYCLE, SUPPLY_PERIODS, Work};
use crate::drive::seen::bus_current;
use crate::drive::shared::Shared;
use crate::math::{Held, sin_cos};
use crate::protection;
use crate::units::{Current, Speed};

/// Pieces in which a drive is made ready, one a period.
pub(in crate::drive) const READY_PIECES: u32 = 5;

/// Outer-loop work before the first period of a drive, in [`READY_PIECES`].
pub(in crate::drive) fn ready(config: &Config, foc: &mut State, shared: &mut Shared, piece: u32) {
    match piece {
        1 => {
            trip_level(config, shared);
            supply(shared);
        }
        2 => longest_vector(config, shared),
        3 => supply_bounds(config, foc, shared),
        4 => speed_bounds(config, foc, shared),
        _ => {
            delay_compensation(config, foc, shared);
            dead_time_sign(config, foc);
        }
    }
}

/// The pieces that follow what is measured, in any mode, and change none.
// In the code of its only caller, of whose longest period a call would be 20 instructions.
#[inline(always)]
pub(in crate::drive) fn work(config: &Config, foc: &mut State, shared: &mut Shared, due: Work) {
    if due.includes(Work::DELAY_COMPENSATION) {
        delay_compensation(config, foc, shared);
    }
    if due.includes(Work::DEAD_TIME_SIGN) {
        dead_time_sign(config, foc);
    }
    if due.includes(Work::OBSERVER_GAINS) {
        observer_gains(config, foc);
    }
    if due.includes(Work::SUPPLY) {
        supply(shared);
    }
    if due.includes(Work::TRIP_LEVEL) {
        trip_level(config, shared);
    }
    if due.includes(Work::SUPPLY_BOUNDS) {
        supply_bounds(config, foc, shared);
    }
    if due.includes(Work::LONGEST_VECTOR) {
        longest_vector(config, shared);
    }
    if due.includes(Work::SPEED_BOUNDS) {
        speed_bounds(config, foc, shared);
    }
    if due.includes(Work::DECOUPLING) {
        decoupling(config, foc, shared);
    }
}

/// The trip follows its limit.
#[inline(always)] // in the longest period
pub(in crate::drive) fn trip_level(config: &Config, shared: &mut Shared) {
    protection::follow_limit(&config.protection, &mut shared.protection, shared.seen.i);
}

/// The supply's voltage and current.
#[inline(never)] // only some periods
pub(in crate::drive) fn supply(shared: &mut Shared) {
    shared.supply.follow(shared.protection.bus);
    shared.seen.bus_current = bus_current(shared.seen.u, shared.seen.i, &shared.supply);
}

/// The longest vector that the supply gives.
#[inline(never)] // only some periods
pub(in crate::drive) fn longest_vector(config: &Config, shared: &mut Shared) {
    shared.supply.reach(&config.modulator, shared.seen.u.d);
}

/// Bounds of i_q by the supply's current.
#[inline(never)] // only some periods
pub(in crate::drive) fn supply_bounds(config: &Config, foc: &mut State, shared: &mut Shared) {
    let seen = &shared.seen;
    protection::bound(
        &config.protection,
        &mut shared.protection,
        (seen.bus_current, seen.i.q),
        SUPPLY_PERIODS,
    );
    // The next reference follows from that; a bound that braking has reached does not wait for it:
    // where the supply takes nothing its voltage rises by volts a millisecond.
    let i_q = &mut foc.loops.reference.i.q;
    *i_q = (*i_q).max(shared.protection.bounds.min);
}

/// Bounds of i_q by the speed, and i_d.
#[inline(never)] // only some periods
pub(in crate::drive) fn speed_bounds(config: &Config, foc: &mut State, shared: &Shared) {
    let bounds = shared.protection.bounds;
    let loops = &mut foc.loops;
    let (i_d, bounds) = config.low_speed.bounds(bounds, shared.seen.speed);
    loops.i_d = protection::burn(&config.protection, &shared.protection, i_d);
    loops.bounds = bounds;
}

/// Run and Stopping: the current's reference.
#[inline(never)] // only some periods
pub(in crate::drive) fn reference(
    config: &Config,
    foc: &mut State,
    shared: &Shared,
    setpoint: &Setpoint,
) {
    let setpoint = if shared.reversed {
        setpoint.mirrored()
    } else {
        *setpoint
    };
    let loops = &mut foc.loops;
    let deficit = core::mem::take(&mut loops.deficit);
    let (command, bounds) = match (shared.seen.phase, setpoint) {
        (Phase::Run, Setpoint::Speed(command)) => (command, loops.bounds),
        (Phase::Run, Setpoint::Torque(i_q) | Setpoint::Test(i_q)) => {
            return commanded(config, foc, shared, Reference::steady(i_q));
        }
        (Phase::Run, Setpoint::Voltage(share)) => {
            let reference = at_voltage(config, foc, shared, share);
            return commanded(config, foc, shared, reference);
        }
        // Stopping, and turning round, is by regenerative braking.
        _ => {
            let braking = Bounds {
                max: Current::ZERO,
                ..loops.bounds
            };
            (Speed::ZERO, braking)
        }
    };
    let input = speed::Input {
        command,
        speed: shared.seen.speed,
        slow_estimate: foc.observer.slow_estimate,
        bounds,
        missing: deficit,
    };
    let before = loops.speed.reference();
    let reference = config.speed.current(&mut loops.speed, &input);
    loops.planned = loops.speed.reference().minus(before) / PERIODS as i32;
    loops.reference =
        torque::grow(&config.torque, &mut loops.torque, reference).with_i_d(loops.i_d);
}

/// The current at which a share of the voltage is given.
// Here, and the next one too: a call would make the longest period longer.
#[inline(always)]
fn at_voltage(
    config: &Config,
    foc: &State,
    shared: &Shared,
    share: fixed::types::I1F31,
) -> Reference {
    let u_q = voltage::of_share(share, shared.supply.longest.length()).max(config.least_u_q);
    let frame = (shared.seen.speed, shared.seen.i);
    let factor = foc.loops.inductance.factor;
    let fb = observer::feedback(&config.observer, &foc.observer, frame, factor);
    let i_d = foc.loops.i_d;
    voltage::reference(&config.regulator, &foc.loops.regulator, &fb, i_d, u_q)
}

/// A current that is commanded, while the speed regulator stands by to take over.
#[inline(always)] // in the longest period
fn commanded(config: &Config, foc: &mut State, shared: &Shared, reference: Reference) {
    let loops = &mut foc.loops;
    let reference = torque::follow(&config.torque, &mut loops.torque, reference, loops.bounds);
    config
        .speed
        .begin(&mut loops.speed, shared.seen.speed, reference.i.q);
    loops.planned = Speed::ZERO;
    loops.reference = reference.with_i_d(loops.i_d);
}

/// Delay compensation: the voltage acts from `delay` to `delay + 1` periods after the sample, while the
/// rotor turns on; it is meant for the middle of that time. Without this the loop is unstable above
/// 4489 rpm on the bench at 15 kHz.
#[inline(always)] // in the longest period
pub(in crate::drive) fn delay_compensation(config: &Config, foc: &mut State, shared: &Shared) {
    foc.loops.advance = sin_cos(config.delay.advance(shared.seen.speed));
}

/// Which way the phases' currents go, for the dead time: two periods behind each reference. Where
/// braking begins i_q* passes zero at 3 A/ms on the bench: once a cycle the sign would be wrong for a
/// millisecond, after which the adaptive back-EMF observer as published swings by 45°.
#[inline(never)] // only some periods
pub(in crate::drive) fn dead_time_sign(config: &Config, foc: &mut State) {
    let loops = &mut foc.loops;
    loops.dead_time_sign =
        dead_time::certainty(&config.dead_time, loops.reference.i, loops.advance);
}

/// Update of the observer's gains, which follow the speed and the torque.
#[inline(never)] // only some periods
pub(in crate::drive) fn observer_gains(config: &Config, foc: &mut State) {
    let follows = (foc.loops.inductance.factor, foc.loops.reference.i.q);
    observer::pace(&config.observer, &mut foc.observer, follows, CYCLE);
}

/// Decoupling of the regulator's axes at this speed.
#[inline(always)] // in the longest period
pub(in crate::drive) fn decoupling(config: &Config, foc: &mut State, shared: &Shared) {
    let factor = foc.loops.inductance.factor;
    config
        .regulator
        .pace(&mut foc.loops.regulator, shared.seen.speed, factor);
}
