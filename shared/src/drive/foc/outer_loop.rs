//! The pieces of outer-loop work.

use siskin_units::math::{Held, sin_cos};
use siskin_units::{Current, Speed, stated_emf};

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
use crate::protection;

/// Pieces that prepare a drive, one per period.
pub(in crate::drive) const PREPARATION_PIECES: u32 = 5;

/// Runs a piece of the outer-loop work before a drive's first period, one of [`PREPARATION_PIECES`].
pub(in crate::drive) fn prepare(config: &Config, foc: &mut State, shared: &mut Shared, piece: u32) {
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

/// Runs the pieces that follow measurements, in any mode, without changing the mode.
// Inlined into its only caller: a call would add 20 instructions to the longest period.
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

/// Makes the trip follow its limit.
#[inline(always)] // in the longest period
pub(in crate::drive) fn trip_level(config: &Config, shared: &mut Shared) {
    protection::follow_limit(&config.protection, &mut shared.protection, shared.seen.i);
}

/// Updates supply voltage and current.
#[inline(never)] // only some periods
pub(in crate::drive) fn supply(shared: &mut Shared) {
    shared.supply.set_bus(shared.protection.bus);
    shared.seen.bus_current = bus_current(shared.seen.u, shared.seen.i, &shared.supply);
}

/// Updates the longest vector that the supply allows.
#[inline(never)] // only some periods
pub(in crate::drive) fn longest_vector(config: &Config, shared: &mut Shared) {
    let (d, speed) = (shared.seen.u.d, shared.seen.speed);
    shared.supply.update_limits_at(&config.modulator, d, speed);
}

/// Updates the bounds of i_q from the supply current.
#[inline(never)] // only some periods
pub(in crate::drive) fn supply_bounds(config: &Config, foc: &mut State, shared: &mut Shared) {
    let seen = &shared.seen;
    protection::bound(
        &config.protection,
        &mut shared.protection,
        (seen.bus_current, seen.i.q),
        SUPPLY_PERIODS,
    );
    // The next reference applies them. A bound that braking has reached does not wait for it: a supply that sinks
    // no current rises by volts per millisecond.
    let i_q = &mut foc.loops.reference.i.q;
    *i_q = (*i_q).max(shared.protection.bounds.min);
}

/// Updates the bounds of i_q from the speed, and i_d.
#[inline(never)] // only some periods
pub(in crate::drive) fn speed_bounds(config: &Config, foc: &mut State, shared: &Shared) {
    let bounds = shared.protection.bounds;
    let loops = &mut foc.loops;
    let (speed, weakening) = (shared.seen.speed, &mut loops.weakening);
    let (i_d, bounds) = config.low_speed.bounds(bounds, speed);
    let longest = &shared.supply.longest;
    config.weakening.step(weakening, speed, longest);
    loops.i_d_reference = if weakening.i_d == Current::ZERO {
        protection::burning_i_d(&config.protection, &shared.protection, i_d)
    } else {
        // It burns power too.
        weakening.i_d
    };
    loops.i_q_bounds = config
        .weakening
        .bounds(weakening, bounds, config.protection.phase);
}

/// Updates the current reference in Run and Stopping.
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
    let i_q_shortfall = core::mem::take(&mut loops.i_q_shortfall);
    let (command, bounds) = match (shared.seen.phase, setpoint) {
        (Phase::Run, Setpoint::Speed(command)) => (command, loops.i_q_bounds),
        (Phase::Run, Setpoint::Torque(i_q) | Setpoint::Test(i_q)) => {
            return follow_command(config, foc, shared, Reference::steady(i_q));
        }
        (Phase::Run, Setpoint::Voltage(share)) => {
            let reference = at_voltage(config, foc, shared, share);
            return follow_command(config, foc, shared, reference);
        }
        // Stopping, and reversing, brake regeneratively.
        _ => {
            let braking = Bounds {
                max: Current::ZERO,
                ..loops.i_q_bounds
            };
            (Speed::ZERO, braking)
        }
    };
    let input = speed::Input {
        command,
        speed: shared.seen.speed,
        slow_estimate: foc.observer.slow_estimate,
        bounds,
        i_q_shortfall,
    };
    let before = loops.speed.reference();
    let reference = config.speed.current(&mut loops.speed, &input);
    loops.reference_step = loops.speed.reference().minus(before) / PERIODS as i32;
    loops.reference =
        torque::grow(&config.torque, &mut loops.torque, reference).with_i_d(loops.i_d_reference);
}

/// Returns the current reference for a share of the voltage.
// Inlined, as the next one: a call would lengthen the longest period.
#[inline(always)]
fn at_voltage(
    config: &Config,
    foc: &State,
    shared: &Shared,
    share: fixed::types::I1F31,
) -> Reference {
    let least = config.least_u_q;
    let mut u_q = voltage::of_share(share, shared.supply.switched).max(least);
    // At idle the dead time may take more than the back-EMF.
    u_q = u_q.plus(voltage::lift(least, stated_emf(shared.seen.speed)));
    if config.weakening.most != Current::ZERO {
        // As if the supply had it all: what i_d takes away is not the throttle's.
        let i_d = foc.loops.weakening.i_d;
        u_q = u_q
            .plus(voltage::beyond(share, shared.supply.switched))
            .plus(config.regulator.induced(&foc.loops.regulator, i_d));
    }
    let frame = (shared.seen.speed, shared.seen.i);
    let factor = foc.loops.inductance.factor;
    let fb = config.observer.feedback(&foc.observer, frame, factor);
    let i_d = foc.loops.i_d_reference;
    voltage::reference(&config.regulator, &foc.loops.regulator, &fb, i_d, u_q)
}

/// Applies a commanded current, while the speed regulator stands by to take over.
#[inline(always)] // in the longest period
fn follow_command(config: &Config, foc: &mut State, shared: &Shared, reference: Reference) {
    let loops = &mut foc.loops;
    let reference = torque::follow(
        &config.torque,
        &mut loops.torque,
        reference,
        loops.i_q_bounds,
    );
    config
        .speed
        .preset(&mut loops.speed, shared.seen.speed, reference.i.q);
    loops.reference_step = Speed::ZERO;
    loops.reference = reference.with_i_d(loops.i_d_reference);
}

/// Delay compensation. The voltage acts from `delay` to `delay + 1` periods after the sample, while the rotor keeps
/// turning; it is aimed at the middle of that time. Without it the loop is unstable above 4489 rpm on the bench at
/// 15 kHz.
#[inline(always)] // in the longest period
pub(in crate::drive) fn delay_compensation(config: &Config, foc: &mut State, shared: &Shared) {
    foc.loops.delay_rotation = sin_cos(config.delay.advance(shared.seen.speed));
}

/// Updates the signs of the phase currents for the dead time, two periods after each reference. Where braking
/// begins, i_q* crosses zero at 3 A/ms on the bench: updated once per cycle, the sign would be wrong for a
/// millisecond, after which the adaptive back-EMF observer as published swings by 45°.
#[inline(never)] // only some periods
pub(in crate::drive) fn dead_time_sign(config: &Config, foc: &mut State) {
    let loops = &mut foc.loops;
    loops.dead_time_sign =
        dead_time::certainty(&config.dead_time, loops.reference.i, loops.delay_rotation);
}

/// Updates the observer's gains, which follow speed and torque.
#[inline(never)] // only some periods
pub(in crate::drive) fn observer_gains(config: &Config, foc: &mut State) {
    let follows = (foc.loops.inductance.factor, foc.loops.reference.i.q);
    observer::schedule_gains(&config.observer, &mut foc.observer, follows, CYCLE);
}

/// Updates the decoupling of the regulator's axes at this speed.
#[inline(always)] // in the longest period
pub(in crate::drive) fn decoupling(config: &Config, foc: &mut State, shared: &Shared) {
    let factor = foc.loops.inductance.factor;
    config
        .regulator
        .schedule_gains(&mut foc.loops.regulator, shared.seen.speed, factor);
}
