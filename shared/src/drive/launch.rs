//! Starting, handing over, stopping: what changes the drive's phase.

use super::config::Stop;
use super::turn::hall;
use super::{ATTEMPTS, Config, Direction, Fault, Phase, Sample, Setpoint, State, tone};
use crate::control::catch::Rotor;
use crate::control::observer;
use crate::control::regulator::Reference;
use crate::control::start;
use crate::control::transform::{AlphaBeta, Dq, inverse_park, rotate_frame, voltages};
use crate::math::sin_cos;
use crate::units::{Angle, Current, Speed, Voltage};

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
        Setpoint::Stop | Setpoint::Zero | Setpoint::Fault(_) | Setpoint::Tone(_) => 0,
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
    if state.phase == Phase::Run && wish == present {
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

/// Begins to drive: the rotor is caught where it turns, started where its sensors show it, or parked.
#[cold]
pub(super) fn begin(config: &Config, state: &mut State, sample: &Sample, setpoint: Setpoint) {
    let backward = wish(config, setpoint) == Wish::Backward;
    match state.rotor {
        Rotor::Turning { theta, omega } if omega.saturating_abs() > config.slow => {
            state.reversed = omega.is_negative() != (config.direction == Direction::Reversed);
            let theta = if state.swapped(config) {
                theta.wrapping_neg()
            } else {
                theta
            };
            catch(config, state, theta, omega.saturating_abs());
            // One that turns the other way is stopped first.
            state.phase = if state.reversed == backward {
                Phase::Run
            } else {
                Phase::Stopping
            };
        }
        _ => {
            state.reversed = backward;
            let hall = hall(sample, state.swapped(config));
            if observer::stand(&config.observer, &mut state.observer, hall) {
                state.phase = Phase::Run;
                config
                    .speed
                    .begin(&mut state.speed, Speed::ZERO, Current::ZERO);
            } else {
                state.phase = Phase::Park;
                observer::align(&config.observer, &mut state.observer, state.start.frame);
            }
        }
    }
}

/// Field-oriented control from a rotor's angle and speed, without current.
fn catch(config: &Config, state: &mut State, theta: Angle, omega: Speed) {
    let rest = AlphaBeta::default();
    observer::begin(&config.observer, &mut state.observer, (theta, omega), rest);
    config.speed.begin(&mut state.speed, omega, Current::ZERO);
    // The back-EMF has been at the terminals, as if it had been commanded. ω has 32 fraction bits,
    // ξ = 1/4, a voltage 28.
    let emf = Dq {
        d: Voltage::ZERO,
        q: Voltage::from_bits(omega.to_bits() >> 2),
    };
    let still = Dq::default();
    let factor = state.inductance.factor;
    let fb = observer::feedback(&config.observer, &state.observer, (omega, still), factor);
    let wanted = Reference::default();
    config
        .regulator
        .begin(&mut state.regulator, emf, &wanted, &fb);
    let to_middle = config.delay.advance(omega).wrapping_sub(omega);
    let commanded =
        |middle: Angle| voltages(inverse_park(emf, sin_cos(theta.wrapping_add(middle))));
    state.commanded = [
        commanded(to_middle),
        commanded(to_middle.wrapping_sub(omega)),
    ];
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

/// Park and Ramp: the frame's speed and the current.
#[inline]
pub(super) fn open_loop(
    config: &Config,
    state: &mut State,
    setpoint: Setpoint,
    i: AlphaBeta<Current>,
) -> (Speed, Reference) {
    let attempt = attempt(config, state);
    let mut i_q = attempt.current.min(state.protection.bounds.max);
    if matches!(setpoint, Setpoint::Test(_)) {
        i_q = i_q.min(config.test_current);
    }
    let omega_s = if state.phase == Phase::Park {
        let (omega, done) = start::park(attempt, &mut state.start, i_q);
        if done {
            state.phase = Phase::Ramp;
            // The rotor's flux stands along the current, on the frame's q axis.
            let rotor = state.start.frame.wrapping_add(Angle::from_bits(1 << 30));
            observer::expect(&config.observer, &mut state.observer, rotor, i);
        }
        omega
    } else {
        start::ramp(attempt, &mut state.start, i_q).0
    };
    (omega_s, Reference::steady(i_q))
}

/// The coefficients of the attempt that is being made.
pub(super) fn attempt<'a>(config: &'a Config, state: &State) -> &'a start::Config {
    &config.start[usize::from(state.failed_starts).min(ATTEMPTS - 1)]
}

/// The phase of the next period: hand-over at the ramp's end, back to the start where the rotor
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
            state.slow_periods += 1;
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
            state.run_periods += 1;
            if state.run_periods == config.proven_periods {
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
    let ahead = sin_cos(lead);
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
    state.phase = Phase::Run;
    None
}
