//! The open-loop start, Park and Ramp, and mode changes caused by the rotor.

use siskin_units::math::SinCos;
use siskin_units::{Current, QUARTER_TURN};

use super::begin;
use super::state::State;
use crate::control::regulator::Reference;
use crate::control::transform::{AlphaBeta, Dq, rotate_frame};
use crate::control::{PERIODS, observer, start};
use crate::drive::config::{ATTEMPTS, Config};
use crate::drive::io::{Rotation, Setpoint};
use crate::drive::phase::Phase;
use crate::drive::schedule::{CYCLE, DAMP_PERIODS};
use crate::drive::shared::Shared;
use crate::drive::transitions::Why;
use crate::protection::Fault;

/// Time after which a rotor that something turns the other way has been braked in vain, over that in which a start is
/// proven: 1.2 s.
const STOP_PROVEN: u32 = 4;

/// The coefficients of the attempt that is being made. What turns the rotor the other way leaves no time for less than
/// the quick attempt's current.
fn attempt<'a>(config: &'a Config, shared: &Shared) -> &'a start::Config {
    let n = if shared.against || shared.latch.quick_attempts > 0 {
        0
    } else {
        usize::from(shared.failed_starts) + 1
    };
    &config.start[n.min(ATTEMPTS)]
}

/// The rotor's swing; once, at the end of Park, where the rotor is.
#[inline(never)] // only some periods
pub(in crate::drive) fn damp(config: &Config, foc: &mut State, shared: &Shared, phase: Phase) {
    let attempt = attempt(config, shared);
    let start = &mut foc.loops.start;
    let is_outer_loop_period = foc.loops.slot % PERIODS as u8 == 1;
    if is_outer_loop_period && phase == Phase::Park && start::aligned(attempt, start) {
        expect_aligned(config, foc, shared);
    } else {
        let measured = (shared.seen.i, shared.seen.u);
        start::damp(attempt, start, measured, DAMP_PERIODS);
    }
}

/// Sets the start's current, and the frame's speed from it.
#[inline(never)] // only some periods
pub(in crate::drive) fn current(
    config: &Config,
    foc: &mut State,
    shared: &Shared,
    phase: Phase,
    setpoint: &Setpoint,
) -> Option<Why> {
    let attempt = attempt(config, shared);
    let mut i_q = attempt.current.min(shared.protection.bounds.max);
    if matches!(setpoint, Setpoint::Test(_)) {
        i_q = i_q.min(config.test_current);
    }
    foc.loops.reference = Reference::steady(i_q);
    let start = &mut foc.loops.start;
    if phase == Phase::Ramp {
        start::ramp(attempt, start, i_q);
        None
    } else {
        start::park(attempt, start, i_q, PERIODS).then_some(Why::Aligned)
    }
}

/// Expects the rotor's flux along the current, on the frame's q axis, and turning with it.
fn expect_aligned(config: &Config, foc: &mut State, shared: &Shared) {
    let frame = foc.loops.start.frame;
    let rotor = frame.wrapping_add(QUARTER_TURN);
    let Dq { d: alpha, q: beta } = rotate_frame(shared.seen.i, SinCos::of(frame.wrapping_neg()));
    let i = AlphaBeta { alpha, beta };
    let omega = foc.loops.start.omega_s;
    observer::begin_aligned(&config.observer, &mut foc.observer, (rotor, omega), i);
}

/// Every [`CYCLE`], returns the mode change the rotor calls for: another attempt if it has not followed or has
/// become too slow, the end of a stop, a fault if it is lost.
#[inline(never)] // only some periods
pub(in crate::drive) fn rotor_mode_change(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    phase: Phase,
    setpoint: &Setpoint,
) -> Option<Why> {
    let lost = foc.observer.slow_estimate.lost && !phase.is_open_loop();
    let progress = &mut shared.progress;
    progress.lost_periods = if lost {
        progress.lost_periods + CYCLE
    } else {
        0
    };
    let slow = shared.seen.speed < config.slow;
    if phase == Phase::Run && !slow {
        progress.slow_periods = 0;
    }
    match phase {
        Phase::Ramp => {
            let has_lost_rotor = start::has_lost_rotor(attempt(config, shared), &foc.loops.start);
            has_lost_rotor.then(|| shared.start_failed())
        }
        // Before the speed check: sensors that fail at standstill are lost there.
        Phase::Run | Phase::Stopping if progress.lost_periods >= config.lost_periods => {
            Some(if progress.run_periods < config.proven_periods {
                shared.start_failed()
            } else {
                Why::Tripped(Fault::ObserverLost)
            })
        }
        Phase::Run if slow => {
            progress.slow_periods += CYCLE;
            (progress.slow_periods > config.slow_periods).then(|| shared.start_failed())
        }
        Phase::Stopping => stopping(config, foc, shared, setpoint),
        Phase::Run if progress.run_periods < config.proven_periods => {
            progress.run_periods += CYCLE;
            if progress.run_periods >= config.proven_periods {
                shared.start_succeeded(config);
            }
            None
        }
        _ => None,
    }
}

/// Ends a stop, at the speed below which the observer does not lead. If the motor is to turn the other way, a ramp takes
/// the rotor there, from twice that speed: in the wind it would gain speed again while it waited for the next start, and
/// what the observer allows to brake with near that speed may hold the wind's torque and no more.
fn stopping(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    setpoint: &Setpoint,
) -> Option<Why> {
    let drives = setpoint.rotation(config.both_ways) != Rotation::Rest;
    if !drives || shared.is_along(config, setpoint) || config.observer.follows_park() {
        return (shared.seen.speed < config.slow).then_some(Why::Stopped);
    }
    if shared.seen.speed < config.slow * 2 {
        turn_round(config, foc, shared, setpoint);
        return Some(Why::Followed);
    }
    // What turns the rotor may be too strong.
    let periods = &mut shared.progress.slow_periods;
    *periods += CYCLE;
    let vain = shared.against && *periods > STOP_PROVEN * config.proven_periods;
    vain.then(|| shared.start_failed())
}

/// Begins a ramp from a rotor that is braked.
#[cold]
fn turn_round(config: &Config, foc: &mut State, shared: &mut Shared, setpoint: &Setpoint) {
    let omega = foc.loops.phase_order.speed(shared.seen.speed);
    begin::follow(config, foc, shared, (shared.seen.angle, omega), setpoint);
    let loops = &mut foc.loops;
    for v in &mut loops.commanded_voltages {
        v.beta = -v.beta;
    }
    // The voltage continues unchanged: the other phase order mirrors q, and the new frame is a quarter turn behind.
    let (u, i) = (shared.seen.u, shared.seen.i);
    let (u, i) = (Dq { d: u.q, q: u.d }, Dq { d: i.q, q: i.d });
    let factor = loops.inductance.factor;
    let omega = loops.start.omega_s;
    let fb = config.observer.feedback(&foc.observer, (omega, i), factor);
    loops.reference = Reference::steady(i.q).with_i_d(i.d);
    config
        .regulator
        .preset(&mut loops.regulator, u, &loops.reference, &fb);
}

/// Prepares the speed regulator for [`hand_over`], shortly before it.
#[cold]
pub(in crate::drive) fn preset_speed_regulator(config: &Config, foc: &mut State) {
    let loops = &mut foc.loops;
    // The ramp current includes the acceleration, which the load does not take.
    config
        .speed
        .preset(&mut loops.speed, loops.start.omega_s, Current::ZERO);
}

/// Ends the ramp: turns the control's frame from the ramp's angle to the rotor, and begins Run with the present
/// torque.
#[cold]
#[inline(never)] // only some periods
pub(in crate::drive) fn hand_over(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    phase: Phase,
) -> Option<Why> {
    let loops = &mut foc.loops;
    let omega_s = loops.start.omega_s;
    if phase != Phase::Ramp || omega_s < attempt(config, shared).run_speed {
        return None;
    }
    let lead = observer::take_over(
        &config.observer,
        &mut foc.observer,
        loops.start.frame,
        omega_s,
    );
    let Some(lead) = lead else {
        return Some(shared.start_failed());
    };
    let lead = SinCos::of(lead);
    // The voltage continues unchanged, in the new frame.
    let u = rotate_frame(shared.seen.u, lead);
    let i = rotate_frame(shared.seen.i, lead);
    let factor = loops.inductance.factor;
    let fb = config
        .observer
        .feedback(&foc.observer, (omega_s, i), factor);
    let reference = Reference::steady(i.q).with_i_d(i.d);
    config
        .regulator
        .preset(&mut loops.regulator, u, &reference, &fb);
    loops.reference = reference;
    Some(Why::HandedOver)
}
