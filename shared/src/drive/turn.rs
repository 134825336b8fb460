//! A period in which the phases switch, and one in which the low sides are on.

use fixed::types::I3F29;

use super::launch;
use super::state::Seen;
use super::{Bridge, Config, Phase, Sample, Setpoint, State};
use crate::control::modulator::{self, Supply};
use crate::control::observer::{self, Estimate, Input};
use crate::control::regulator::{Feedback, Reference};
use crate::control::speed::{self, Bounds};
use crate::control::transform::{self, AlphaBeta, Dq, clarke, inverse_park, park, voltages};
use crate::control::{dead_time, inductance, start, torque, voltage};
use crate::math::{Held, TopProduct, sin_cos};
use crate::protection;
use crate::units::{AdcCounts, Angle, Current, Speed, Voltage};

/// A period in which the phases switch.
#[inline(always)]
pub(super) fn period(
    config: &Config,
    state: &mut State,
    sample: &Sample,
    currents: [AdcCounts; 3],
    setpoint: Setpoint,
) -> Bridge {
    let setpoint = if state.reversed {
        setpoint.turned()
    } else {
        setpoint
    };
    let swapped = state.swapped(config);
    let supply = Supply::new(&config.modulator, state.protection.bus);
    let stator = clarke(in_order(swapped, currents));
    let input = input(config, state, (sample, swapped), stator);
    let open_loop = matches!(state.phase, Phase::Park | Phase::Ramp);
    let imposed = open_loop.then_some(state.start.omega_s);
    let estimate = observer::estimate(&config.observer, &mut state.observer, &input, imposed);

    let (theta, fb, wanted) = if open_loop {
        let theta = state.start.frame;
        let i = park(stator, sin_cos(theta));
        let (omega_s, wanted) = launch::open_loop(config, state, setpoint, input.i);
        let attempt = launch::attempt(config, state);
        let omega = start::damp(attempt, &mut state.start, (i, state.seen.u), omega_s);
        (theta, feedback(config, state, omega, i), wanted)
    } else {
        let i = park(stator, estimate.frame);
        let fb = feedback(config, state, estimate.omega, i);
        let wanted = run(config, state, setpoint, &estimate, &fb, supply.vector_max);
        (estimate.theta, fb, wanted)
    };
    let (omega, i) = (fb.omega, fb.i);

    let asked = config.regulator.voltage(&state.regulator, &wanted, &fb);
    let (u, cut) = modulator::limit(asked, supply.vector_max);
    config
        .regulator
        .integrate(&mut state.regulator, &wanted, &fb, cut);
    state.missing = if cut.is_some() {
        wanted.i.q.minus(i.q)
    } else {
        Current::ZERO
    };
    observer::advance(&config.observer, &mut state.observer, &fb, u);

    let bus_current = bus_current(u, i, &supply);
    protection::bound(&config.protection, &mut state.protection, bus_current, i.q);
    state.seen = Seen {
        phase: state.phase,
        angle: in_frame(swapped, theta),
        speed: if open_loop {
            state.start.omega_s
        } else {
            estimate.omega_bar
        },
        i,
        u,
        bus_current,
    };
    if let Some(fault) = launch::proceed(config, state) {
        state.trip(fault);
    }
    // What has ended switches no more.
    match state.phase {
        Phase::Idle => return Bridge::Off,
        Phase::Brake => return Bridge::Brake,
        _ => {}
    }

    // The voltage acts from `delay` to `delay + 1` periods after the sample, while the rotor turns
    // on: aimed at the middle of that time. Without this the loop is unstable above 4489 rpm on
    // the bench at 15 kHz.
    let ahead = sin_cos(theta.wrapping_add(config.delay.advance(omega)));
    let v = inverse_park(u, ahead);
    state.commanded = [voltages(v), state.commanded[0]];
    let compensation = dead_time::compensation(&config.dead_time, inverse_park(wanted.i, ahead));
    let duties = modulator::duties(&config.modulator, &supply, v, compensation);
    let duties = in_order(swapped, duties);
    state.applied[0] = duties;
    Bridge::Duty(duties)
}

/// What the observer reads at this sample.
#[inline(always)]
fn input(
    config: &Config,
    state: &State,
    (sample, swapped): (&Sample, bool),
    stator: AlphaBeta<I3F29>,
) -> Input {
    let [now, before] = state.commanded;
    Input {
        i: transform::currents(stator),
        v: AlphaBeta {
            alpha: config.delay.applied(now.alpha, before.alpha),
            beta: config.delay.applied(now.beta, before.beta),
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

/// What the current regulator reads.
#[inline(always)]
fn feedback(config: &Config, state: &State, omega: Speed, i: Dq<Current>) -> Feedback {
    let factor = state.inductance.factor;
    observer::feedback(&config.observer, &state.observer, (omega, i), factor)
}

/// Run and Stopping: the current reference.
#[inline(always)]
fn run(
    config: &Config,
    state: &mut State,
    setpoint: Setpoint,
    estimate: &Estimate,
    fb: &Feedback,
    vector_max: Voltage,
) -> Reference {
    state.lost_periods = if estimate.lost {
        state.lost_periods + 1
    } else {
        0
    };
    let (mut i_d, full) = config
        .low_speed
        .bounds(state.protection.bounds, estimate.omega_bar);
    if let Some(adapt) = &config.adapt_l {
        let flux = observer::flux(&config.observer, &state.observer);
        i_d += inductance::step(adapt, &mut state.inductance, fb.i.d, flux);
    }
    let (command, bounds) = match (state.phase, setpoint) {
        (Phase::Run, Setpoint::Speed(command)) => (command, full),
        (Phase::Run, Setpoint::Torque(i_q) | Setpoint::Test(i_q)) => {
            let wanted = Reference::steady(i_q).with_i_d(i_d);
            return directly(config, state, estimate, wanted, full);
        }
        (Phase::Run, Setpoint::Voltage(share)) => {
            let u_q = voltage::of_share(share, vector_max);
            let (regulator, integrators) = (&config.regulator, &state.regulator);
            let wanted = voltage::reference(regulator, integrators, fb, i_d, u_q);
            return directly(config, state, estimate, wanted, full);
        }
        // Stopping, and turning round, is by regenerative braking.
        _ => (
            Speed::ZERO,
            Bounds {
                max: Current::ZERO,
                ..full
            },
        ),
    };
    let input = speed::Input {
        command,
        estimate: *estimate,
        bounds,
        missing: state.missing,
    };
    let before = state.speed.reference();
    let wanted = config.speed.current(&mut state.speed, &input);
    state.planned = state.speed.reference().minus(before);
    torque::grow(&config.torque, &mut state.torque, wanted).with_i_d(i_d)
}

/// A current that is commanded, while the speed regulator stands by to take over.
#[inline]
fn directly(
    config: &Config,
    state: &mut State,
    estimate: &Estimate,
    wanted: Reference,
    bounds: Bounds,
) -> Reference {
    let wanted = torque::follow(&config.torque, &mut state.torque, wanted, bounds);
    config
        .speed
        .begin(&mut state.speed, estimate.omega_bar, wanted.i.q);
    state.planned = Speed::ZERO;
    wanted
}

/// With the low sides on the voltage is known to be zero: the observer goes on, so that the speed
/// is reported down to where its back-EMF drowns in noise.
pub(super) fn watch(config: &Config, state: &mut State, sample: &Sample, currents: [AdcCounts; 3]) {
    let swapped = state.swapped(config);
    let stator = clarke(in_order(swapped, currents));
    state.commanded = [AlphaBeta::default(), state.commanded[0]];
    let input = input(config, state, (sample, swapped), stator);
    let estimate = observer::estimate(&config.observer, &mut state.observer, &input, None);
    let i = park(stator, estimate.frame);
    let u = Dq::default();
    let fb = feedback(config, state, estimate.omega, i);
    observer::advance(&config.observer, &mut state.observer, &fb, u);
    // An eighth of the speed at which Run ends: 19 rpm with the defaults.
    let turns = estimate.omega_bar.to_bits() > config.slow.to_bits() >> 3;
    state.seen = Seen {
        phase: Phase::Brake,
        angle: in_frame(swapped, estimate.theta),
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

/// An angle of the control's frame with the phases in the order a, b, c.
#[inline(always)]
fn in_frame(swapped: bool, theta: Angle) -> Angle {
    if swapped { theta.wrapping_neg() } else { theta }
}

/// A phase's reading as a current: one unit is 4096/3 counts.
pub(super) fn reading(counts: AdcCounts) -> Current {
    Current::from_bits(counts.to_bits().saturating_mul(3))
}

/// What the supply gives: 1.5·(v·i)/V_bus.
#[inline(always)]
pub(super) fn bus_current(u: Dq<Voltage>, i: Dq<Current>, supply: &Supply) -> Current {
    // 24 + 28 − 32 fraction bits; 28 wanted.
    let two_thirds = (u.d.top(i.d) + u.q.top(i.q))
        .top(supply.reciprocal)
        .to_bits()
        << 8;
    Current::from_bits(two_thirds + (two_thirds >> 1))
}
