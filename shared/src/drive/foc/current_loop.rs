//! The current loop: from the sampled currents to the phase duties.

use super::state::{Loops, State};
use crate::control::delay::Delay;
use crate::control::observer::{Input, Observer};
use crate::control::regulator::Regulator;
use crate::control::transform::{AlphaBeta, Dq, PhaseOrder, inverse_park, park, rotate, voltages};
use crate::control::{modulator, start};
use crate::drive::config::Config;
use crate::drive::io::{Bridge, Sample, hall};
use crate::drive::phase::Phase;
use crate::drive::shared::Shared;
use crate::math::{Held, SinCos, sin_cos};
use crate::units::{Current, Speed, Voltage, WideVoltage};

/// State of field-oriented control, and the state shared by all modes.
pub(in crate::drive) type Drive<'a> = (&'a mut State, &'a mut Shared);

/// The control's frame in a period: cosine and sine, and speed.
pub(super) type Frame = (SinCos, Speed);

/// Returns the frame from the observer.
#[inline(always)] // in each period
pub(super) fn observed(
    (observer, delay): (&impl Observer, Delay),
    (foc, shared): Drive<'_>,
    sample: &Sample,
    stator: AlphaBeta<Current>,
) -> Frame {
    let State {
        loops,
        observer: of,
    } = foc;
    let input = input(loops, delay, sample, stator);
    let estimate = observer.estimate(of, &input, None);
    shared.seen.angle = loops.order.angle(estimate.theta);
    shared.seen.speed = estimate.omega_bar;
    (estimate.frame, estimate.omega)
}

/// Returns the frame that an open-loop start imposes; the observer runs along.
#[inline(always)] // in each period
pub(super) fn imposed(
    (observer, delay): (&impl Observer, Delay),
    (foc, shared): Drive<'_>,
    sample: &Sample,
    stator: AlphaBeta<Current>,
) -> Frame {
    let State {
        loops,
        observer: of,
    } = foc;
    if shared.seen.phase == Phase::Ramp || observer.follows_park() {
        let input = input(loops, delay, sample, stator);
        observer.estimate(of, &input, Some(loops.start.omega_s));
    }
    let theta = loops.start.frame;
    shared.seen.angle = loops.order.angle(theta);
    shared.seen.speed = loops.start.omega_s;
    (sin_cos(theta), start::advance(&mut loops.start))
}

/// Runs the loop from the current in a frame to the duties, with this observer and regulator.
#[inline(always)] // in each period
pub(super) fn current_loop(
    (observer, regulator): (&impl Observer, &impl Regulator),
    config: &Config,
    (foc, shared): Drive<'_>,
    (frame, omega): Frame,
    stator: AlphaBeta<Current>,
) -> Bridge {
    let State {
        loops,
        observer: of,
    } = foc;
    let i = park(stator, frame);
    shared.seen.i = i;

    // The voltage that drives the current to its reference, as far as the supply allows.
    let fb = observer.feedback(of, (omega, i), loops.inductance.factor);
    let wanted = regulator.voltage(&loops.regulator, &loops.reference, &fb);
    regulator.integrate(&mut loops.regulator, &loops.reference, &fb);
    let u = if modulator::square_of(wanted) <= shared.supply.readable {
        modulator::short(wanted)
    } else {
        limited(regulator, loops, shared, wanted)
    };
    observer.advance(of, &fb, u);
    shared.seen.u = u;

    // The duties, for where the frame will be when they act.
    let v = inverse_park(rotate(u, loops.advance), frame);
    loops.commanded = [voltages(v), loops.commanded[0]];
    let dead_time = (&config.dead_time, inverse_park(loops.dead_time_sign, frame));
    let duties = modulator::duties(
        &config.modulator,
        &shared.supply,
        (v, loops.order),
        dead_time,
    );
    shared.applied.command(duties);
    Bridge::Duty(duties)
}

/// Handles a voltage vector too long to read every phase, or for the supply. Anti-windup: the regulator's
/// integrators take back what the limit cuts off, and the speed regulator is informed.
#[cold]
fn limited(
    regulator: &impl Regulator,
    loops: &mut Loops,
    shared: &mut Shared,
    wanted: Dq<WideVoltage>,
) -> Dq<Voltage> {
    shared.applied.expect_unreadable();
    let (u, cut) = modulator::limit(wanted, &shared.supply.longest);
    if let Some(cut) = cut {
        regulator.anti_windup(&mut loops.regulator, cut);
        loops.deficit = loops.reference.i.q.minus(shared.seen.i.q);
    }
    u
}

/// Returns the observer's input at this sample.
#[inline(always)] // in each period
pub(super) fn input(
    loops: &Loops,
    delay: Delay,
    sample: &Sample,
    stator: AlphaBeta<Current>,
) -> Input {
    let swapped = loops.order == PhaseOrder::SWAPPED;
    let [now, before] = loops.commanded;
    Input {
        i: stator,
        v: AlphaBeta {
            alpha: delay.applied(now.alpha, before.alpha),
            beta: delay.applied(now.beta, before.beta),
        },
        inductance: loops.inductance.factor,
        planned: loops.planned,
        hall: hall(sample, swapped),
        swapped,
    }
}
