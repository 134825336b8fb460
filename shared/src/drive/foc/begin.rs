//! The beginning of a drive after Charge, in pieces: a flying start if the rotor turns.

use siskin_units::math::SinCos;
use siskin_units::{Angle, Current, Speed, Voltage, stated_emf};

use super::outer_loop::{self, PREPARATION_PIECES};
use super::state::State;
use crate::control::catch::Rotor;
use crate::control::regulator::Reference;
use crate::control::transform::{AlphaBeta, Dq, PhaseOrder, inverse_park, rotate, voltages};
use crate::control::{observer, start};
use crate::drive::config::{Config, Direction};
use crate::drive::io::{Rotation, Sample, Setpoint, hall};
use crate::drive::schedule;
use crate::drive::shared::Shared;
use crate::drive::transitions::Why;

// The periods after Charge, from 1, that prepare a drive. The first ones are the outer loop's; those of a flying start
// have nothing to do if the rotor stands.
const OBSERVER: u32 = PREPARATION_PIECES + 1;
const OBSERVER_GAINS: u32 = OBSERVER + 1;
const REGULATOR: u32 = OBSERVER_GAINS + 1;
const COMMANDED: u32 = REGULATOR + 1;

/// Periods after Charge that prepare a drive.
pub(in crate::drive) const PREPARATION_PERIODS: u32 = COMMANDED + 1;

/// Prepares a drive, one piece a period: this is period `n`, from 1. In the last one the rotor is caught if it turns,
/// followed if it turns slowly, started from where its sensors show it, or parked.
#[cold]
pub(in crate::drive) fn begin(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    rotor: Rotor,
    sample: &Sample,
    setpoint: &Setpoint,
    n: u32,
) -> Option<Why> {
    let turning = turning(config, shared, rotor);
    // Until the first driving period.
    let periods = PREPARATION_PERIODS as i32 + 1 - n as i32;
    match (n, turning) {
        (1..=PREPARATION_PIECES, _) => outer_loop::prepare(config, foc, shared, n),
        (OBSERVER, Some((theta, omega))) => {
            let theta = theta.wrapping_add(omega.over_periods(periods));
            let rest = AlphaBeta::default();
            observer::begin(&config.observer, &mut foc.observer, (theta, omega), rest);
        }
        (OBSERVER_GAINS, Some(_)) => outer_loop::observer_gains(config, foc),
        (REGULATOR, Some((_, omega))) => preset_regulator(config, foc, omega),
        (COMMANDED, Some((theta, omega))) => {
            let theta = theta.wrapping_add(omega.over_periods(periods));
            foc.loops.commanded_voltages = commanded_voltages(config, theta, omega);
        }
        // Where sensors show a rotor at rest, Run updates it six periods after it has begun.
        (COMMANDED, None) => {
            let supply = &mut shared.supply;
            supply.limit_as_from(&config.modulator, config.start_bus);
        }
        (PREPARATION_PERIODS, _) => {
            let omega = turning.map(|(_, omega)| omega);
            let begun = enter_drive(config, foc, shared, sample, setpoint, omega);
            return Some(match rotor {
                Rotor::Turning { theta, omega }
                    if begun == Why::Stands && !config.observer.follows_park() =>
                {
                    follow(config, foc, shared, (theta, omega), setpoint);
                    Why::Followed
                }
                _ => begun,
            });
        }
        _ => {}
    }
    None
}

/// Returns the rotor's angle and speed as the control sees them, if it turns fast enough to catch.
fn turning(config: &Config, shared: &mut Shared, rotor: Rotor) -> Option<(Angle, Speed)> {
    match rotor {
        Rotor::Turning { theta, omega } if omega.saturating_abs() > config.slow => {
            shared.reversed = omega.is_negative() != (config.direction == Direction::Reversed);
            let theta = if shared.swapped(config) {
                theta.wrapping_neg()
            } else {
                theta
            };
            Some((theta, omega.saturating_abs()))
        }
        _ => None,
    }
}

/// Begins a drive; returns the reason for its mode, for a rotor that turns at `omega` or stands.
fn enter_drive(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    sample: &Sample,
    setpoint: &Setpoint,
    omega: Option<Speed>,
) -> Why {
    let backward = setpoint.rotation(config.both_ways) == Rotation::Backward;
    // The first period computes its reference.
    foc.loops.slot = schedule::LAST;
    if omega.is_none() {
        shared.reversed = backward;
        shared.against = false;
    }
    let swapped = shared.swapped(config);
    foc.loops.phase_order = PhaseOrder::of(swapped);
    let speed = &mut foc.loops.speed;
    if let Some(omega) = omega {
        config.speed.preset(speed, omega, Current::ZERO);
        // A rotor that turns the other way is stopped first.
        let was_against = shared.against;
        shared.against = shared.reversed != backward;
        if shared.against {
            if !was_against {
                shared.failed_starts = 0;
            }
            Why::CaughtBackwards
        } else {
            Why::Caught
        }
    } else {
        let (frame, hall) = (foc.loops.start.frame, hall(sample, swapped));
        if observer::begin_at_rest(&config.observer, &mut foc.observer, frame, hall) {
            config.speed.preset(speed, Speed::ZERO, Current::ZERO);
            Why::Caught
        } else {
            Why::Stands
        }
    }
}

/// Begins a ramp with a frame that turns with the rotor, which is at this angle and speed for the phase order a, b, c:
/// Park would not hold one that the wind turns.
#[cold]
#[inline(never)] // three callers
pub(in crate::drive) fn follow(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    (theta, omega): (Angle, Speed),
    setpoint: &Setpoint,
) {
    shared.reversed = setpoint.rotation(config.both_ways) == Rotation::Backward;
    let order = PhaseOrder::of(shared.swapped(config));
    let (theta, omega) = (order.angle(theta), order.speed(omega));
    shared.against = omega.is_negative();
    shared.progress = Default::default();
    let loops = &mut foc.loops;
    loops.phase_order = order;
    loops.start = start::State::aligned_to(theta.wrapping_add(omega.over_period()), omega);
    loops.slot = schedule::ALIGNED;
    let supply = &mut shared.supply;
    supply.limit_as_from(&config.modulator, config.start_bus);
}

/// Resumes driving from the present speed and current.
#[cold]
pub(in crate::drive) fn resume(config: &Config, foc: &mut State, shared: &Shared) {
    let (speed, i_q) = (shared.seen.speed, shared.seen.i.q);
    config.speed.preset(&mut foc.loops.speed, speed, i_q);
}

/// Returns the back-EMF at this speed.
fn emf(omega: Speed) -> Dq<Voltage> {
    Dq {
        d: Voltage::ZERO,
        q: stated_emf(omega),
    }
}

/// Presets the current regulator at this speed, without current.
fn preset_regulator(config: &Config, foc: &mut State, omega: Speed) {
    let still = Dq::default();
    let loops = &mut foc.loops;
    let factor = loops.inductance.factor;
    let fb = config
        .observer
        .feedback(&foc.observer, (omega, still), factor);
    let reference = Reference::default();
    config
        .regulator
        .preset(&mut loops.regulator, emf(omega), &reference, &fb);
}

/// Returns the last two commands for a rotor at `theta` at the first period's sample: the back-EMF
/// was at the terminals, as if commanded.
fn commanded_voltages(config: &Config, theta: Angle, omega: Speed) -> [AlphaBeta<Voltage>; 2] {
    let to_middle = config
        .delay
        .advance(omega)
        .wrapping_sub(omega.over_period());
    let frame = SinCos::of(theta);
    let emf = emf(omega);
    let at = |middle: Angle| voltages(inverse_park(rotate(emf, SinCos::of(middle)), frame));
    [
        at(to_middle),
        at(to_middle.wrapping_sub(omega.over_period())),
    ]
}
