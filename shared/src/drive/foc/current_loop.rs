//! The current loop: from the sampled currents to the phase duties.

use siskin_params::Delay;
use siskin_units::math::{Held, SinCos, TopProduct, sin_cos};
use siskin_units::{Current, Duty, Speed, Voltage, WideVoltage};

use super::state::{Loops, State};
use crate::control::modulator::{Phases, Supply};
use crate::control::observer::Input;
use crate::control::transform::{AlphaBeta, Dq, PhaseOrder, inverse_park, park, rotate, voltages};
use crate::control::{modulator, overmodulation, start};
use crate::drive::config::Config;
use crate::drive::io::{Bridge, Sample, hall};
use crate::drive::phase::Phase;
use crate::drive::shared::Shared;

/// The control's frame in a period.
#[derive(Clone, Copy)]
pub(super) struct Frame {
    /// Its angle's cosine and sine.
    angle: SinCos,
    /// Its speed.
    omega: Speed,
}

/// Returns the frame from the observer.
#[inline(always)] // in each period
pub(super) fn observed(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    sample: &Sample,
    stator: AlphaBeta<Current>,
) -> Frame {
    let loops = &mut foc.loops;
    let input = input(loops, config.delay, sample, stator);
    let estimate = config.observer.estimate(&mut foc.observer, &input, None);
    shared.seen.angle = loops.phase_order.angle(estimate.theta);
    shared.seen.speed = estimate.omega_bar;
    Frame {
        angle: estimate.frame,
        omega: estimate.omega,
    }
}

/// Returns the frame that an open-loop start imposes; the observer runs along.
#[inline(always)] // in each period
pub(super) fn imposed(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    sample: &Sample,
    stator: AlphaBeta<Current>,
) -> Frame {
    let loops = &mut foc.loops;
    if shared.seen.phase == Phase::Ramp || config.observer.follows_park() {
        let input = input(loops, config.delay, sample, stator);
        config
            .observer
            .estimate(&mut foc.observer, &input, Some(loops.start.omega_s));
    }
    let theta = loops.start.frame;
    shared.seen.angle = loops.phase_order.angle(theta);
    shared.seen.speed = loops.start.omega_s;
    Frame {
        angle: sin_cos(theta),
        omega: start::advance(&mut loops.start),
    }
}

/// Runs the loop from the current in a frame to the duties.
#[inline(always)] // in each period
pub(super) fn current_loop(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    frame: Frame,
    stator: AlphaBeta<Current>,
) -> Bridge {
    let loops = &mut foc.loops;
    let i = park(stator, frame.angle);
    shared.seen.i = i;

    // The voltage that drives the current to its reference, as far as the supply allows.
    let (observer, regulator) = (&config.observer, &config.regulator);
    let fb = observer.feedback(&foc.observer, (frame.omega, i), loops.inductance.factor);
    let demand = regulator.voltage(&loops.regulator, &loops.reference, &fb);
    regulator.integrate(&mut loops.regulator, &loops.reference, &fb);
    let u = if modulator::square_of(demand) <= shared.supply.readable_square {
        modulator::short(demand)
    } else {
        limited(config, loops, shared, demand, frame.angle)
    };
    observer.advance(&mut foc.observer, &fb, u);
    shared.seen.u = u;

    // The duties, for where the frame will be when they act.
    let v = inverse_park(rotate(u, loops.delay_rotation), frame.angle);
    loops.commanded_voltages = [voltages(v), loops.commanded_voltages[0]];
    let duties = if shared.applied.may_be_unreadable() {
        // One by one: an array that may come in memory would be in memory in every period.
        let [a, b, c] = long_duties(config, loops, &shared.supply, frame.angle);
        [a, b, c]
    } else {
        let certainty = inverse_park(loops.dead_time_sign, frame.angle);
        let (order, dead_time) = (loops.phase_order, &config.dead_time);
        let phases = Phases::new(&shared.supply, v, order, dead_time, certainty);
        modulator::duties(&config.modulator, &phases)
    };
    shared.applied.command(duties);
    Bridge::Duty(duties)
}

/// Returns the duties of the commanded vector, if it may be too long to read every phase.
#[cold]
#[inline(never)] // few periods
fn long_duties(config: &Config, loops: &Loops, supply: &Supply, angle: SinCos) -> [Duty; 3] {
    let [v, _] = loops.commanded_voltages;
    let v = AlphaBeta {
        alpha: v.alpha.scaled(),
        beta: v.beta.scaled(),
    };
    let (order, dead_time) = (loops.phase_order, &config.dead_time);
    let certainty = inverse_park(loops.dead_time_sign, angle);
    let phases = Phases::new(supply, v, order, dead_time, certainty);
    overmodulation::duties(&config.modulator, &phases)
}

/// Handles a voltage vector too long to read every phase, or for the supply. Anti-windup: the regulator's
/// integrators take back what the limit cuts off, and the speed regulator is informed.
#[cold]
fn limited(
    config: &Config,
    loops: &mut Loops,
    shared: &mut Shared,
    demand: Dq<WideVoltage>,
    angle: SinCos,
) -> Dq<Voltage> {
    shared.applied.expect_unreadable();
    let longest = &shared.supply.longest;
    let (u, cut) = modulator::limit(demand, longest);
    if let Some(cut) = cut {
        config.regulator.anti_windup(&mut loops.regulator, cut);
        let speed = shared.seen.speed;
        if !config.weakening.helps(&loops.weakening, speed, longest) {
            loops.i_q_shortfall = loops.reference.i.q.minus(shared.seen.i.q);
        }
    }
    // A slow rotor's flux is not weakened.
    if longest.length() > shared.supply.switched {
        overmodulated(config, loops, shared, (u, cut), angle)
    } else {
        u
    }
}

/// Returns what the hexagon leaves of a vector, of which the limit has cut a part.
#[cold]
#[inline(never)] // it would lengthen the shorter vectors' way
fn overmodulated(
    config: &Config,
    loops: &mut Loops,
    shared: &Shared,
    (u, cut): (Dq<Voltage>, Option<Dq<WideVoltage>>),
    angle: SinCos,
) -> Dq<Voltage> {
    loops.weakening.note(u, cut, &shared.supply.longest);
    let v = inverse_park(rotate(u, loops.delay_rotation), angle);
    let linear = config.modulator.linear.top(shared.supply.bus).scaled();
    let Some(over) = overmodulation::beyond_hexagon(v, linear) else {
        return u;
    };
    // Back from where the frame will be.
    let Dq { d, q } = park(over, angle);
    let over = park(AlphaBeta { alpha: d, beta: q }, loops.delay_rotation);
    let over: Dq<Voltage> = Dq {
        d: over.d.scaled(),
        q: over.q.scaled(),
    };
    Dq {
        d: u.d.minus(over.d),
        q: u.q.minus(over.q),
    }
}

/// Returns the observer's input at this sample.
#[inline(always)] // in each period
pub(super) fn input(
    loops: &Loops,
    delay: Delay,
    sample: &Sample,
    stator: AlphaBeta<Current>,
) -> Input {
    let swapped = loops.phase_order == PhaseOrder::SWAPPED;
    let [now, before] = loops.commanded_voltages;
    Input {
        i: stator,
        v: AlphaBeta {
            alpha: delay.applied(now.alpha, before.alpha),
            beta: delay.applied(now.beta, before.beta),
        },
        inductance: loops.inductance.factor,
        reference_step: loops.reference_step,
        hall: hall(sample, swapped),
        swapped,
    }
}
