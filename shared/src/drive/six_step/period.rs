//! A period of the six-step drive.

use siskin_units::{AdcCounts, Speed};

use super::duty::{self, NO_CURRENT, bridge, hold, take_over};
use super::given::Position;
use super::state::State;
use super::{advance, given, outer, start, telemetry};
use crate::control::six_step::commutation::{HALF_SEXTANT, SEXTANT};
use crate::control::six_step::crossing::{self, Leg};
use crate::control::six_step::tracking::FEW_PERIODS;
use crate::drive::config;
use crate::drive::config::six_step::{Config, LOST_SEXTANTS, PATIENCE_SEEN};
use crate::drive::io::{Bridge, Rotation, Sample, Setpoint, in_order};
use crate::drive::phase::Phase;
use crate::drive::seen::reading;
use crate::drive::shared::Shared;
use crate::drive::transitions::Why;
use crate::protection::Fault;

/// Consecutive periods without current after which the shaft counts as standing.
const STILL_PERIODS: u16 = 1000;

/// Returns true if a shaft turns too fast for a start: it is left to slow down first.
pub(in crate::drive) fn is_too_fast(
    config: &config::Config,
    six_step: &Config,
    shared: &Shared,
    (position, setpoint): (Position, &Setpoint),
) -> bool {
    let may_be_caught = position.is_some() && shared.is_along(config, setpoint);
    shared.seen.speed > six_step.run_speed && !may_be_caught
}

/// Resumes Run from the present speed and duty.
pub(in crate::drive) fn resume(s: &mut State, shared: &Shared) {
    take_over(s, shared.protection.bounds);
}

/// Begins a start.
pub(in crate::drive) fn begin(
    config: &config::Config,
    six_step: &Config,
    (s, shared): (&mut State, &mut Shared),
    (position, setpoint): (Position, &Setpoint),
) -> Why {
    *s = State::default();
    shared.shown = Default::default();
    shared.reversed = setpoint.rotation(config.both_ways) == Rotation::Backward;
    match position {
        Some(position) => {
            given::begin(config, six_step, (s, shared), position);
            Why::Caught
        }
        None => Why::Seeks,
    }
}

/// Watches for standstill with the low sides on, where a turning shaft drives a current. The shaft
/// has stopped after a while without current; until then the reported speed decays slowly.
pub(in crate::drive) fn watch(
    config: &config::Config,
    (s, shared): (&mut State, &mut Shared),
    currents: [AdcCounts; 3],
) {
    let [a, b, c] = currents.map(AdcCounts::saturating_abs);
    s.still = if a.max(b).max(c) > NO_CURRENT {
        0
    } else {
        s.still.saturating_add(1)
    };
    if s.still >= STILL_PERIODS {
        shared.seen.speed = Speed::ZERO;
    } else {
        shared.coast(config);
    }
}

/// Runs a period of Ramp, Run or Stopping.
// Not inlined among the other modes: it needs many more registers.
#[inline(never)]
pub(in crate::drive) fn period(
    config: &config::Config,
    six_step: &Config,
    (s, shared): (&mut State, &mut Shared),
    (phase, position): (Phase, Position),
    (sample, setpoint): (&Sample, &Setpoint),
    currents: [AdcCounts; 3],
) -> (Bridge, Option<Why>) {
    s.next();
    let swapped = shared.swapped(config);
    let currents = in_order(swapped, currents);
    let terminals = in_order(swapped, sample.terminals);
    let ramping = phase == Phase::Ramp;
    let legs = s.sector.legs(currents);
    // The leg that was on before the last commutation carries the full current, the other one only
    // what the released phase has left.
    let i = if s.sector.rising() {
        reading(legs.switching)
    } else {
        reading(legs.low).saturating_neg()
    };
    // With the switching leg at the supply only the new low leg's current is seen, until the released phase's has
    // decayed.
    let was_high = s.were_high >> six_step.crossing.delayed & 1 != 0;
    let i = if s.sector.rising() && was_high && s.crossing.blind() {
        i.max(s.duty.smoothed)
    } else {
        i
    };

    if let Some(position) = position {
        given::follow(six_step, (s, shared), position);
    } else if !crossings(six_step, (s, shared), terminals, ramping) {
        return (Bridge::Off, Some(start::lost(six_step, (s, shared), phase)));
    }

    let (mut shown, mut why) = (phase, None);
    if ramping {
        let ramp_current = start::current(six_step, (s, shared), setpoint);
        hold(six_step, s, i, ramp_current);
        if s.tracking.is_known() && s.tracking.omega_bar >= six_step.run_speed {
            take_over(s, shared.protection.bounds);
            (shown, why) = (Phase::Run, Some(Why::HandedOver));
        }
    } else {
        duty::run(six_step, s, i);
        let is_due = if s.tracking.omega_bar >= FEW_PERIODS {
            // A sextant has begun: its samples are then all of one kind.
            s.crossing.samples == 0
        } else {
            s.slot.is_multiple_of(2)
        };
        if is_due {
            s.duty.choose(&six_step.duty);
        }
        if !s.is_busy {
            let slow = s.tracking.omega_bar < six_step.slow;
            let rotor_is = (slow, position.is_some());
            why = rotor(config, six_step, (s, shared), phase, rotor_is);
        }
    }
    telemetry::update(config, (s, shared), shown, currents);
    if why.is_none() {
        why = outer::run(config, six_step, (s, shared), setpoint, (currents, i));
    }
    (bridge(six_step, (s, shared), swapped), why)
}

/// Returns how the rotor ends Run or Stopping.
fn rotor(
    config: &config::Config,
    six_step: &Config,
    (s, shared): (&mut State, &mut Shared),
    phase: Phase,
    (slow, given): (bool, bool),
) -> Option<Why> {
    let run_periods = &mut shared.progress.run_periods;
    match phase {
        Phase::Stopping if slow => {
            s.still = 0;
            Some(Why::Stopped)
        }
        Phase::Run if slow && given => {
            given::is_stuck(config, shared).then_some(Why::Tripped(Fault::Stuck))
        }
        Phase::Run if slow => Some(start::lost(six_step, (s, shared), phase)),
        Phase::Run if *run_periods < config.proven_periods => {
            *run_periods += 1;
            if *run_periods == config.proven_periods {
                shared.start_succeeded(config);
            }
            None
        }
        _ => None,
    }
}

/// Looks for the crossing and commutates by it. Returns false if the rotor is no longer tracked.
fn crossings(
    six_step: &Config,
    (s, shared): (&mut State, &Shared),
    terminals: [AdcCounts; 3],
    ramping: bool,
) -> bool {
    s.tracking.advance();
    let terminal = s.sector.legs(terminals).floating;
    let terminal = six_step.terminal.held(terminal);
    let rising = s.sector.rising();
    let seeking = ramping && !s.tracking.is_known();
    let leg = leg(six_step, s);
    let found = crossing::look(
        &six_step.crossing,
        &mut s.crossing,
        rising,
        seeking,
        s.tracking.certain(),
        terminal,
        (leg, shared.protection.bus),
    );
    advance::note(six_step, s);
    let is_early = s.end < HALF_SEXTANT && !s.crossing.found;
    let found = if is_early && s.tracking.reaches(s.end, six_step.delay) {
        // The sextant ends before the crossing can be seen.
        s.crossing.expected()
    } else {
        found
    };
    if let Some(age) = found {
        s.crossing.found = true;
        s.tracking.crossed(age);
        s.is_busy = true;
        // A crossing that is only expected proves no rotor.
        s.missed = if s.crossing.shows_rotor(&six_step.crossing) {
            0
        } else {
            s.missed.saturating_add(1)
        };
    }
    commutate(six_step, s, ramping);
    s.astray = if seeking {
        s.astray.saturating_add(1)
    } else {
        0
    };
    let patience = u32::from(six_step.astray) << shared.failed_starts;
    s.missed < LOST_SEXTANTS && u32::from(s.astray) < patience
}

/// Returns where the switching leg was at the sample: with a period of delay between the last two commands.
fn leg(six_step: &Config, s: &State) -> Leg {
    let both = (2 << six_step.crossing.delayed) - 1;
    match s.were_high & both {
        0 => Leg::Low,
        high if high == both => Leg::High,
        _ => Leg::Changes,
    }
}

/// Commutates if due.
///
/// Until Ramp knows the rotor, a crossing ends its sextant at once. The rotor is then a quarter turn behind the current, or
/// it has just swung to its backward end, and in the next sextant is pulled forwards from either; when it will be half a
/// sextant further, nobody knows. A sextant without a crossing ends by its time.
fn commutate(six_step: &Config, s: &mut State, ramping: bool) {
    let seeking = ramping && !s.tracking.is_known();
    let found = s.crossing.found;
    let blind = s.crossing.blind();
    let patience = six_step.patience * if blind { 1 } else { PATIENCE_SEEN };
    let is_over = s.crossing.samples >= patience;
    let due = if seeking {
        found || is_over
    } else if found || blind {
        // If nothing was seen, the released phase's current hid the crossing, or the rotor was
        // already past it: the estimate tells when the sextant ends.
        s.tracking.reaches(s.end, six_step.delay)
    } else if ramping {
        is_over
    } else {
        s.tracking.reaches(SEXTANT, six_step.delay)
    };
    if !due {
        return;
    }
    if found || (blind && !seeking && s.tracking.crossings > 0) {
        s.tracking.commutated();
    } else {
        s.tracking.forced();
    }
    if !found && !seeking {
        s.missed += 1;
    }
    s.is_busy = true;
    s.sector = s.sector.next();
    advance::begin(six_step, s);
    s.crossing.begin(&six_step.crossing);
}
