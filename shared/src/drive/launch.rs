//! Starting, handing over, stopping: what changes the drive's phase.

use super::config::Stop;
use super::slow::{self, CYCLE};
use super::turn::hall;
use super::{ATTEMPTS, Config, Direction, Fault, Phase, Sample, Setpoint, State, tone};
use crate::control::catch::Rotor;
use crate::control::regulator::Reference;
use crate::control::start;
use crate::control::transform::{AlphaBeta, Dq, Order, inverse_park, rotate_frame, turn, voltages};
use crate::control::{PERIODS, observer};
use crate::math::SinCos;
use crate::units::{Angle, Current, Speed, Voltage, stated_emf};

/// Which way a set-point wants the motor to turn, against the configured direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wish {
    /// Not at all.
    Rest,
    /// In the configured direction.
    Forward,
    /// The other way.
    Backward,
}

impl Wish {
    /// The way in which the motor turns, or is being started.
    pub(super) fn present(state: &State) -> Self {
        if state.reversed {
            Self::Backward
        } else {
            Self::Forward
        }
    }
}

/// The wish of a set-point.
pub(super) fn wish(config: &Config, setpoint: Setpoint) -> Wish {
    let sign = match setpoint {
        Setpoint::Speed(speed) => speed.to_bits(),
        Setpoint::Torque(current) | Setpoint::Test(current) => current.to_bits(),
        Setpoint::Voltage(share) => share.to_bits(),
        Setpoint::Stop
        | Setpoint::Zero
        | Setpoint::Fault(_)
        | Setpoint::Tone(_)
        | Setpoint::Pull(_) => 0,
    };
    // A test is of either direction; else the other way is for who has asked for both.
    let both_ways = config.both_ways || matches!(setpoint, Setpoint::Test(_));
    if sign > 0 {
        Wish::Forward
    } else if sign < 0 && both_ways {
        Wish::Backward
    } else {
        Wish::Rest
    }
}

/// Changes the phase where the set-point asks for it.
#[inline(always)]
pub(super) fn follow(config: &Config, state: &mut State, setpoint: Setpoint) {
    let wish = wish(config, setpoint);
    let present = Wish::present(state);
    if matches!(state.phase, Phase::Run | Phase::Park | Phase::Ramp) && wish == present {
        return;
    }
    if tone::follow(config, state, setpoint) {
        return;
    }
    // A torque against the rotation slows the motor down within Run, but does not turn it round.
    let holds = matches!(setpoint, Setpoint::Torque(_) | Setpoint::Test(_))
        && state.seen.speed >= config.slow;
    // The bridge is off at once: without current, and the terminals tell how the shaft turns.
    let coasts = config.stop == Stop::Coast && wish == Wish::Rest && !holds;
    match state.phase {
        Phase::Run | Phase::Stopping if coasts => end(config, state),
        Phase::Run if wish != present && !holds => state.phase = Phase::Stopping,
        Phase::Stopping if wish == present => resume(config, state),
        Phase::Brake if wish == present && state.seen.speed > config.slow => resume(config, state),
        Phase::Idle | Phase::Brake if wish != Wish::Rest => state.rest(Phase::Sense),
        Phase::Idle | Phase::Brake => state.failed_starts = 0,
        Phase::Park | Phase::Ramp if wish != present => {
            state.failed_starts = 0;
            end(config, state);
        }
        _ => {}
    }
}

/// Periods behind Charge in which a drive is made ready, a piece in each.
pub(super) const READY_PERIODS: u32 = 10;

/// Piece `n`, from 1, of what makes a drive ready: the rotor is caught where it turns, started where
/// its sensors show it, or parked, from the period after the last piece on.
#[cold]
pub(super) fn begin(
    config: &Config,
    state: &mut State,
    (sample, setpoint): (&Sample, Setpoint),
    n: u32,
) {
    let caught = turning(config, state);
    // Until the first period that drives.
    let periods = READY_PERIODS as i32 + 1 - n as i32;
    match (n, caught) {
        (1..=5, _) => slow::begin(config, state, n),
        (6, Some((theta, omega))) => {
            let theta = theta.wrapping_add(omega.over_periods(periods));
            let rest = AlphaBeta::default();
            observer::begin(&config.observer, &mut state.observer, (theta, omega), rest);
        }
        (7, Some(_)) => {
            let factor = state.inductance.factor;
            observer::pace(&config.observer, &mut state.observer, factor, CYCLE);
        }
        (8, Some((_, omega))) => regulate(config, state, omega),
        (9, Some((theta, omega))) => {
            let theta = theta.wrapping_add(omega.over_periods(periods));
            state.commanded = commanded(config, theta, omega);
        }
        (READY_PERIODS, _) => {
            go(
                config,
                state,
                (sample, setpoint),
                caught.map(|(_, omega)| omega),
            );
        }
        _ => {}
    }
}

/// The rotor's angle and speed as the control sees them, where it turns fast enough to be caught.
fn turning(config: &Config, state: &mut State) -> Option<(Angle, Speed)> {
    match state.rotor {
        Rotor::Turning { theta, omega } if omega.saturating_abs() > config.slow => {
            state.reversed = omega.is_negative() != (config.direction == Direction::Reversed);
            let theta = if state.swapped(config) {
                theta.wrapping_neg()
            } else {
                theta
            };
            Some((theta, omega.saturating_abs()))
        }
        _ => None,
    }
}

/// The first phase of a drive, for a rotor that turns at `omega`, or stands.
fn go(
    config: &Config,
    state: &mut State,
    (sample, setpoint): (&Sample, Setpoint),
    omega: Option<Speed>,
) {
    let backward = wish(config, setpoint) == Wish::Backward;
    // The first period takes its reference.
    state.turn = CYCLE as u8 - 1;
    if omega.is_none() {
        state.reversed = backward;
    }
    let swapped = state.swapped(config);
    state.order = if swapped {
        Order::SWAPPED
    } else {
        Order::NORMAL
    };
    state.phase = if let Some(omega) = omega {
        config.speed.begin(&mut state.speed, omega, Current::ZERO);
        // One that turns the other way is stopped first.
        if state.reversed == backward {
            Phase::Run
        } else {
            Phase::Stopping
        }
    } else {
        let (frame, hall) = (state.start.frame, hall(sample, swapped));
        if observer::stand(&config.observer, &mut state.observer, frame, hall) {
            config
                .speed
                .begin(&mut state.speed, Speed::ZERO, Current::ZERO);
            Phase::Run
        } else {
            Phase::Park
        }
    };
}

/// The back-EMF at this speed.
fn emf(omega: Speed) -> Dq<Voltage> {
    Dq {
        d: Voltage::ZERO,
        q: stated_emf(omega),
    }
}

/// The current regulator at this speed, without current.
fn regulate(config: &Config, state: &mut State, omega: Speed) {
    let still = Dq::default();
    let factor = state.inductance.factor;
    let fb = observer::feedback(&config.observer, &state.observer, (omega, still), factor);
    let wanted = Reference::default();
    config
        .regulator
        .begin(&mut state.regulator, emf(omega), &wanted, &fb);
}

/// The back-EMF has been at the terminals, as if it had been commanded: the last two commands, for a
/// rotor that is at `theta` at the first period's sample.
fn commanded(config: &Config, theta: Angle, omega: Speed) -> [AlphaBeta<Voltage>; 2] {
    let to_middle = config
        .delay
        .advance(omega)
        .wrapping_sub(omega.over_period());
    let frame = SinCos::of(theta);
    let emf = emf(omega);
    let at = |middle: Angle| voltages(inverse_park(turn(emf, SinCos::of(middle)), frame));
    [
        at(to_middle),
        at(to_middle.wrapping_sub(omega.over_period())),
    ]
}

/// Drives on from the speed and the current that there are.
#[cold]
fn resume(config: &Config, state: &mut State) {
    state.phase = Phase::Run;
    let (speed, i_q) = (state.seen.speed, state.seen.i.q);
    config.speed.begin(&mut state.speed, speed, i_q);
}

/// What follows when there is nothing left to slow down.
#[cold]
pub(super) fn end(config: &Config, state: &mut State) {
    state.rest(match config.stop {
        Stop::Coast => Phase::Idle,
        Stop::Brake => Phase::Brake,
    });
}

/// Periods from one look at the rotor's swing to the next: every other one, those in which nothing
/// else has its turn. A swing takes hundreds of them.
const DAMP_PERIODS: u32 = 2;

/// Park and Ramp: what of the imposed frame has its turn in this period.
#[inline(always)]
pub(super) fn impose(config: &Config, state: &mut State, setpoint: &Setpoint) {
    if !state.turn.is_multiple_of(DAMP_PERIODS as u8) {
        damp(config, state);
    } else if state.turn.is_multiple_of(PERIODS as u8) {
        current(config, state, setpoint);
    }
}

/// The rotor's swing; once, at the end of Park, where the rotor is.
#[inline(never)]
fn damp(config: &Config, state: &mut State) {
    let attempt = attempt(config, state);
    let first = state.turn % PERIODS as u8 == 1;
    if first && state.phase == Phase::Park && start::aligned(attempt, &state.start) {
        expect(config, state);
    } else {
        let felt = (state.seen.i, state.seen.u);
        start::damp(attempt, &mut state.start, felt, DAMP_PERIODS);
    }
}

/// The current, and what it makes of the frame's speed.
#[inline(never)]
fn current(config: &Config, state: &mut State, setpoint: &Setpoint) {
    let attempt = attempt(config, state);
    let mut i_q = attempt.current.min(state.protection.bounds.max);
    if matches!(setpoint, Setpoint::Test(_)) {
        i_q = i_q.min(config.test_current);
    }
    state.wanted = Reference::steady(i_q);
    if state.phase == Phase::Ramp {
        start::ramp(attempt, &mut state.start, i_q);
    } else if start::park(attempt, &mut state.start, i_q, PERIODS) {
        state.phase = Phase::Ramp;
    }
    state.seen.phase = state.phase;
}

/// The rotor's flux stands along the current, on the frame's q axis.
fn expect(config: &Config, state: &mut State) {
    let frame = state.start.frame;
    let rotor = frame.wrapping_add(Angle::from_bits(1 << 30));
    let Dq { d: alpha, q: beta } = rotate_frame(state.seen.i, SinCos::of(frame.wrapping_neg()));
    let i = AlphaBeta { alpha, beta };
    observer::expect(&config.observer, &mut state.observer, rotor, i);
}

/// The coefficients of the attempt that is being made.
pub(super) fn attempt<'a>(config: &'a Config, state: &State) -> &'a start::Config {
    &config.start[usize::from(state.failed_starts).min(ATTEMPTS - 1)]
}

/// Every [`CYCLE`]: the phase of the next period, hand-over at the ramp's end, back to the start where the rotor
/// has not followed or has become too slow. `Some` where the observer is lost, or nothing starts
/// the motor.
#[inline(always)]
pub(super) fn proceed(config: &Config, state: &mut State) -> Option<Fault> {
    if state.phase == Phase::Run && state.seen.speed >= config.slow {
        state.slow_periods = 0;
    }
    match state.phase {
        Phase::Ramp if start::lost(attempt(config, state), &state.start) => failed(state),
        Phase::Ramp if state.start.omega_s >= attempt(config, state).run_speed => {
            hand_over(config, state)
        }
        // Before the speed is looked at: sensors that fail at standstill are lost there.
        Phase::Run | Phase::Stopping if state.lost_periods >= config.lost_periods => {
            if state.run_periods < config.proven_periods {
                failed(state)
            } else {
                Some(Fault::ObserverLost)
            }
        }
        Phase::Run if state.seen.speed < config.slow => {
            state.slow_periods += CYCLE;
            if state.slow_periods > config.slow_periods {
                failed(state)
            } else {
                None
            }
        }
        Phase::Stopping if state.seen.speed < config.slow => {
            end(config, state);
            None
        }
        Phase::Run if state.run_periods < config.proven_periods => {
            state.run_periods += CYCLE;
            if state.run_periods >= config.proven_periods {
                state.failed_starts = 0;
            }
            None
        }
        _ => None,
    }
}

/// A start has failed, or the motor has become too slow: the next attempt, if there is one.
#[cold]
fn failed(state: &mut State) -> Option<Fault> {
    state.rest(Phase::Idle);
    state.failed_starts += 1;
    (usize::from(state.failed_starts) >= ATTEMPTS).then_some(Fault::Stuck)
}

/// Turns the control's frame from where the ramp held it to where the rotor is, and begins Run
/// with the torque that there is.
#[cold]
fn hand_over(config: &Config, state: &mut State) -> Option<Fault> {
    let omega_s = state.start.omega_s;
    let lead = observer::take_over(
        &config.observer,
        &mut state.observer,
        state.start.frame,
        omega_s,
    );
    let Some(lead) = lead else {
        return failed(state);
    };
    let ahead = SinCos::of(lead);
    // The voltage goes on as it was, in the new frame.
    let u = rotate_frame(state.seen.u, ahead);
    let i = rotate_frame(state.seen.i, ahead);
    let factor = state.inductance.factor;
    let fb = observer::feedback(&config.observer, &state.observer, (omega_s, i), factor);
    let wanted = Reference::steady(i.q).with_i_d(i.d);
    config
        .regulator
        .begin(&mut state.regulator, u, &wanted, &fb);
    // What the ramp's current accelerates with is not what the load takes.
    config.speed.begin(&mut state.speed, omega_s, Current::ZERO);
    state.wanted = wanted;
    state.phase = Phase::Run;
    None
}
