//! The control period.

use fixed::types::I1F31;

use super::config::{DeadTime, Direction, Stop};
use super::state::Seen;
use super::{Bridge, Config, Fault, Faults, Phase, Sample, Setpoint, State};
use crate::control::modulator::{self, Supply};
use crate::control::observer::{Estimate, back_emf};
use crate::control::regulator::{Feedback, Reference, observer_based as regulator};
use crate::control::speed::{self, Bounds};
use crate::control::transform::{AlphaBeta, Dq, clarke, inverse_park, park, phases, rotate_frame};
use crate::control::{planner, start};
use crate::math::{SinCos, TopProduct, sin_cos};
use crate::protection;
use crate::units::{AdcCounts, Current, Speed, Torque, Voltage};

/// One control period: from the sample to what the bridge does in the period that follows.
///
/// Pure: no clock, no allocation, no logging, and no result but the state and the returned value.
/// Called once a PWM period, in the interrupt of the chip and in the emulator's loop.
pub fn step(config: &Config, state: &mut State, sample: Sample, setpoint: Setpoint) -> Bridge {
    let bus = config.bus.saturating_apply(sample.bus);
    let found = protection::check(
        &config.protection,
        &mut state.protection,
        sample.currents,
        bus,
    );
    if let Some(fault) = found {
        state.trip(fault);
    }
    if let Setpoint::Fault(fault) = setpoint {
        state.trip(fault);
    }
    if !state.faults.is_empty() {
        latched(config, state, setpoint);
        return Bridge::Off;
    }
    follow(config, state, setpoint);
    match state.phase {
        Phase::Idle => {
            state.coast(config);
            Bridge::Off
        }
        Phase::Brake => {
            watch(config, state, sample.currents);
            Bridge::Brake
        }
        Phase::Park | Phase::Ramp | Phase::Run | Phase::Stopping => {
            drive(config, state, sample.currents, setpoint)
        }
    }
}

/// A fault ends when zero throttle has stood for a while without its cause: the tasks have seen it
/// by then, and a limit that is grazed does not come and go.
#[cold]
fn latched(config: &Config, state: &mut State, setpoint: Setpoint) {
    state.coast(config);
    if setpoint != Setpoint::Zero {
        state.clear_periods = 0;
    } else if state.clear_periods < config.clear_periods {
        state.clear_periods += 1;
    } else {
        state.faults = Faults::NONE;
    }
}

/// Changes the phase where the set-point asks for it.
#[inline(always)]
fn follow(config: &Config, state: &mut State, setpoint: Setpoint) {
    let wanted = !matches!(
        setpoint,
        Setpoint::Stop | Setpoint::Zero | Setpoint::Fault(_)
    );
    // No current, or one against the rotation, brakes what turns but starts nothing.
    let starts = match setpoint {
        Setpoint::Torque(current) | Setpoint::Test(current) => current > Current::ZERO,
        Setpoint::Voltage(share) => share > I1F31::ZERO,
        _ => wanted,
    };
    match state.phase {
        Phase::Stopping if wanted => resume(state),
        Phase::Brake if wanted && state.seen.speed > config.start.run_speed => resume(state),
        // A shaft that may still turn too fast to be parked is left to slow down first.
        Phase::Idle | Phase::Brake if starts && state.seen.speed <= config.start.run_speed => {
            state.rest(Phase::Park);
            state.observer = back_emf::State {
                xi: config.observer.xi_nominal,
                ..back_emf::State::default()
            };
        }
        Phase::Park | Phase::Ramp if !wanted => end(config, state),
        Phase::Run if !wanted => state.phase = Phase::Stopping,
        _ => {}
    }
}

/// Drives on from the speed and the current that there are.
#[cold]
fn resume(state: &mut State) {
    state.phase = Phase::Run;
    state.reference = state.seen.speed;
    state.speed.sigma = torque(state.seen.i.q);
}

/// What follows when there is nothing left to slow down.
#[cold]
fn end(config: &Config, state: &mut State) {
    state.rest(match config.stop {
        Stop::Coast => Phase::Idle,
        Stop::Brake => Phase::Brake,
    });
}

/// A period in which the phases switch.
#[inline(always)]
fn drive(
    config: &Config,
    state: &mut State,
    currents: [AdcCounts; 3],
    setpoint: Setpoint,
) -> Bridge {
    let supply = Supply::new(&config.modulator, state.protection.bus);
    let theta = state.observer.theta;
    let i = park(clarke(in_order(config, currents)), sin_cos(theta));
    let estimate = back_emf::estimate(&config.observer, &mut state.observer);

    let (omega, speed, wanted) = match state.phase {
        Phase::Run | Phase::Stopping => (
            estimate.omega,
            estimate.omega_bar,
            run(config, state, setpoint, &estimate),
        ),
        _ => open_loop(config, state, setpoint),
    };

    let feedback = Feedback {
        omega,
        i,
        i_hat: state.observer.i,
        h_hat: state.observer.h,
    };
    let u = regulator::voltage(&config.regulator, &state.regulator, wanted, &feedback);
    let (u, limited) = modulator::limit(u, supply.vector_max);
    if !limited {
        regulator::integrate(&config.regulator, &mut state.regulator, wanted, &feedback);
    }
    back_emf::advance(&config.observer, &mut state.observer, omega, i, u);

    let bus_current = bus_current(u, i, &supply);
    protection::bound(&config.protection, &mut state.protection, bus_current);
    state.seen = Seen {
        phase: state.phase,
        angle: theta,
        speed,
        i,
        u,
        bus_current,
    };
    if let Some(fault) = proceed(config, state) {
        state.trip(fault);
        return Bridge::Off;
    }

    // The voltage acts from `delay` to `delay + 1` periods after the sample, while the rotor turns
    // on: aimed at the middle of that time. Without this the loop is unstable above 4489 rpm on
    // the bench at 15 kHz.
    let ahead = sin_cos(theta.wrapping_add(config.observer.delay.advance(omega)));
    let v = inverse_park(u, ahead);
    let compensation = dead_time(&config.dead_time, wanted.i.q, ahead);
    let duties = modulator::duties(&config.modulator, &supply, v, compensation);
    Bridge::Duty(in_order(config, duties))
}

/// Run and Stopping: the current reference.
#[inline(always)]
fn run(config: &Config, state: &mut State, setpoint: Setpoint, estimate: &Estimate) -> Reference {
    let at_end = back_emf::adapt(&config.observer, &mut state.observer, estimate.xi_step);
    state.lost_periods = if at_end { state.lost_periods + 1 } else { 0 };

    let full = state.protection.bounds;
    let (command, bounds) = match (setpoint, config.stop) {
        (Setpoint::Speed(command), _) => (command, full),
        (Setpoint::Torque(current) | Setpoint::Test(current), _) => {
            let i_q = current.min(full.max).max(full.min);
            state.reference = estimate.omega_bar;
            state.speed.sigma = torque(i_q);
            return Reference::steady(i_q);
        }
        (_, Stop::Brake) => (
            Speed::ZERO,
            Bounds {
                max: Current::ZERO,
                ..full
            },
        ),
        (_, Stop::Coast) => (Speed::ZERO, Bounds::default()),
    };
    let (reference, step) = planner::plan(state.reference, command, config.slew);
    state.reference = reference;
    speed::current(
        &config.speed,
        &mut state.speed,
        (reference, step),
        estimate,
        bounds,
    )
}

/// Park and Ramp: the frame's speed, which is also what is reported, and the current.
#[inline]
fn open_loop(config: &Config, state: &mut State, setpoint: Setpoint) -> (Speed, Speed, Reference) {
    let mut i_q = config.start.current.min(state.protection.bounds.max);
    if matches!(setpoint, Setpoint::Test(_)) {
        i_q = i_q.min(config.start.test_current);
    }
    let (omega, done) = if state.phase == Phase::Park {
        start::park(&config.start, &mut state.start, i_q)
    } else {
        start::ramp(&config.start, &mut state.start, i_q)
    };
    if done && state.phase == Phase::Park {
        state.phase = Phase::Ramp;
    }
    let (h_d, xi) = (state.observer.h.d, config.observer.xi_nominal);
    let yields = start::damp(&config.start, &mut state.start, h_d, omega, xi);
    (omega.saturating_add(yields), omega, Reference::steady(i_q))
}

/// The phase of the next period: hand-over at the ramp's end, back to the start where the rotor
/// has not followed or has become too slow. `Some` where the observer is lost.
#[inline(always)]
fn proceed(config: &Config, state: &mut State) -> Option<Fault> {
    match state.phase {
        Phase::Ramp if state.start.omega_s >= config.start.run_speed => hand_over(config, state),
        Phase::Run if state.seen.speed < config.slow => state.rest(Phase::Idle),
        Phase::Stopping if state.seen.speed < config.slow => end(config, state),
        Phase::Run | Phase::Stopping if state.lost_periods >= config.lost_periods => {
            return Some(Fault::ObserverLost);
        }
        _ => {}
    }
    None
}

/// Turns the control's frame from where the ramp held it to where the rotor is, and begins Run
/// with the torque that there is.
#[cold]
fn hand_over(config: &Config, state: &mut State) {
    let omega_s = state.start.omega_s;
    let observer = &mut state.observer;
    let Some(lead) = start::rotor_lead(observer.h, omega_s, config.observer.xi_nominal) else {
        state.rest(Phase::Idle);
        return;
    };
    let ahead = sin_cos(lead);
    *observer = back_emf::State {
        theta: observer.theta.wrapping_add(lead),
        i: rotate_frame(observer.i, ahead),
        h: rotate_frame(observer.h, ahead),
        xi: config.observer.xi_nominal,
        omega_f: omega_s,
        u_before: rotate_frame(observer.u_before, ahead),
    };
    state.regulator.sigma = rotate_frame(state.regulator.sigma, ahead);
    state.speed.sigma = torque(observer.i.q);
    state.reference = omega_s;
    state.phase = Phase::Run;
}

/// With the low sides on the voltage is known to be zero: the observer goes on, so that the speed
/// is reported down to where its back-EMF drowns in noise.
fn watch(config: &Config, state: &mut State, currents: [AdcCounts; 3]) {
    let theta = state.observer.theta;
    let i = park(clarke(in_order(config, currents)), sin_cos(theta));
    let estimate = back_emf::estimate(&config.observer, &mut state.observer);
    back_emf::adapt(&config.observer, &mut state.observer, estimate.xi_step);
    let omega = estimate.omega;
    back_emf::advance(
        &config.observer,
        &mut state.observer,
        omega,
        i,
        Dq::default(),
    );
    // An eighth of the speed at which Run ends: 19 rpm with the defaults.
    let turns = estimate.omega_bar.to_bits() > config.slow.to_bits() >> 3;
    state.seen = Seen {
        phase: Phase::Brake,
        angle: theta,
        speed: if turns {
            estimate.omega_bar
        } else {
            Speed::ZERO
        },
        i,
        u: Dq::default(),
        bus_current: Current::ZERO,
    };
}

/// The torque of a current with the stated flux, ξ = 1/4.
fn torque(i_q: Current) -> Torque {
    i_q.saturating_mul_int(4)
}

/// Phases b and c change places where the direction is reversed.
#[inline(always)]
fn in_order<T>(config: &Config, [a, b, c]: [T; 3]) -> [T; 3] {
    match config.direction {
        Direction::Normal => [a, b, c],
        Direction::Reversed => [a, c, b],
    }
}

/// What the supply gives: 1.5·(v·i)/V_bus.
#[inline(always)]
fn bus_current(u: Dq<Voltage>, i: Dq<Current>, supply: &Supply) -> Current {
    // 24 + 28 − 32 fraction bits; 28 wanted.
    let two_thirds = (u.d.top(i.d) + u.q.top(i.q))
        .top(supply.reciprocal)
        .to_bits()
        << 8;
    Current::from_bits(two_thirds + (two_thirds >> 1))
}

/// The duty that the dead time takes from each phase by the sign of its current, here that of the
/// reference: it has no noise. Around zero it is in proportion.
#[inline(always)]
fn dead_time(config: &DeadTime, i_q: Current, ahead: SinCos) -> [I1F31; 3] {
    let along_q = AlphaBeta {
        alpha: -i_q.top(ahead.sin),
        beta: i_q.top(ahead.cos),
    };
    phases(along_q).map(|current| {
        let share = config.slope.saturating_apply(current);
        share.min(config.duty).max(-config.duty)
    })
}
