//! The six-step drive's period: from the sample to what the bridge does, by zero crossings.
//!
//! The phases are those of the field-oriented drive. Park holds the rotor along one phase and then
//! along another, so that one that stood opposite to the first does not stay there. Ramp begins as
//! it stands there, or at the forward end of its swing. While nothing can be seen of the rotor it
//! commutates by a speed that grows by `STA_RAMP_RPM_S`; crossings correct that as soon as there are
//! some. Run begins when a turn of them has been seen in a row at `STA_RUN_RPM`.

mod given;
mod start;
mod state;
mod tell;

pub use state::State;

use fixed::types::{I1F31, I36F28};

use super::launch::{self, Wish};
use super::{Bridge, Phase, Sample, Setpoint, Stop, rest, tone, turn};
use crate::control::delay::Delay;
use crate::control::planner;
use crate::control::six_step::commutation::{HALF_SEXTANT, Legs, SEXTANT};
use crate::control::six_step::tracking::KNOWN;
use crate::control::six_step::{crossing, duty};
use crate::control::speed::Bounds;
use crate::math::{Gain, Held, TopProduct};
use crate::units::{AdcCounts, Current, Duty, Speed, Voltage};

/// Sextants in a row without a crossing after which the rotor is lost: two turns.
pub(crate) const LOST_SEXTANTS: u8 = 12;

/// Sextants without a crossing for which one counts that Ramp has waited for in vain: three of them
/// end the start.
const IMPATIENCE: u8 = 4;

/// Readings up to which there is no current: noise, and what is left of an offset. On the bench 0.3 A
/// are 20 rpm.
const NO_CURRENT: AdcCounts = AdcCounts::lit("16");

/// What a shaft may gain in speed while it is to stop, as a part of the least that it has had.
const GAINED_PART: i32 = 64;

/// Periods in a row without a current after which the shaft stands.
const STILL_PERIODS: u16 = 1000;

/// Coefficients of the six-step drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Counts of a terminal's converter to voltage.
    pub terminal: Gain<AdcCounts, Voltage>,
    /// Zero crossings.
    pub crossing: crossing::Config,
    /// From the command to ω*, period by period.
    pub planner: planner::Config,
    /// The outer loop.
    pub duty: duty::Config,
    /// From the sample to the commutation that it leads to.
    pub delay: Delay,
    /// Greatest current against the rotation. Braking, a released phase's back-EMF holds up its
    /// current, and a large one would hide every crossing.
    pub braking: Current,
    /// Current of Park and Ramp.
    pub start_current: Current,
    /// Greatest current of a test of the motor.
    pub test_current: Current,
    /// Current times periods for which the first angle of Park is held; the second is held twice as
    /// long.
    pub park_charge: I36F28,
    /// Current to the change of Ramp's speed in a period.
    pub ramp: Gain<Current, Speed>,
    /// Samples for which Ramp waits for a crossing that is to come.
    pub patience: u16,
    /// Periods after which a Ramp that has not seen a turn of crossings in a row has failed.
    pub astray: u16,
    /// Speed at which Run may begin.
    pub run_speed: Speed,
    /// Speed below which Run ends.
    pub slow: Speed,
}

/// What is wanted of a motor that turns the way it does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Demand {
    /// Nothing, or the other way: it is to be stopped.
    Rest,
    /// A speed above zero.
    Speed(Speed),
    /// A current, negative to brake.
    Current(Current),
    /// A share of the supply above zero.
    Share(I1F31),
}

/// One period without faults.
pub(super) fn period(
    config: &super::Config,
    six_step: &Config,
    state: &mut super::State,
    sample: &Sample,
    currents: [AdcCounts; 3],
    setpoint: Setpoint,
) -> Bridge {
    follow(config, six_step, state, setpoint);
    state.seen.phase = state.phase;
    if let Some(bridge) = rest::period(config, state, sample, (currents, setpoint)) {
        return bridge;
    }
    if state.phase == Phase::Charge {
        begin(config, six_step, state, setpoint);
    }
    match state.phase {
        Phase::Brake => {
            watch(config, state, currents);
            Bridge::Brake
        }
        Phase::Park => start::park(config, six_step, state, currents, setpoint),
        _ => turn(config, six_step, state, (sample, currents), setpoint),
    }
}

/// With the low sides on, a shaft that turns drives a current. It has stopped when there has been
/// none for a while; until then what is reported falls slowly.
fn watch(config: &super::Config, state: &mut super::State, currents: [AdcCounts; 3]) {
    let [a, b, c] = currents.map(AdcCounts::saturating_abs);
    let s = &mut state.six_step;
    s.still = if a.max(b).max(c) > NO_CURRENT {
        0
    } else {
        s.still.saturating_add(1)
    };
    if s.still >= STILL_PERIODS {
        state.seen.speed = Speed::ZERO;
    } else {
        state.coast(config);
    }
}

/// Changes the phase where the set-point asks for it.
fn follow(config: &super::Config, six_step: &Config, state: &mut super::State, setpoint: Setpoint) {
    if state.phase != Phase::Run && tone::follow(config, state, setpoint) {
        return;
    }
    let resting = demand(setpoint, state.reversed) == Demand::Rest;
    // A shaft that turns too fast to be parked is left to slow down first.
    let too_fast = state.seen.speed > six_step.run_speed
        && !(given::is_given(config) && along(config, state, setpoint));
    match state.phase {
        Phase::Stopping if !resting => {
            state.phase = Phase::Run;
            run_from_here(state);
        }
        Phase::Idle | Phase::Brake if launch::wish(config, setpoint) != Wish::Rest && !too_fast => {
            state.rest(Phase::Sense);
        }
        Phase::Sense | Phase::Charge if too_fast => state.rest(Phase::Idle),
        Phase::Park | Phase::Ramp if !along(config, state, setpoint) => end(config, state),
        Phase::Run if resting => {
            state.phase = Phase::Stopping;
            run_from_here(state);
        }
        _ => {}
    }
}

/// Whether the set-point wants the motor to turn the way in which it is being started.
fn along(config: &super::Config, state: &super::State, setpoint: Setpoint) -> bool {
    launch::wish(config, setpoint) == Wish::present(state)
}

/// Begins a start.
fn begin(config: &super::Config, six_step: &Config, state: &mut super::State, setpoint: Setpoint) {
    state.six_step = State::default();
    state.rest(Phase::Park);
    state.reversed = launch::wish(config, setpoint) == Wish::Backward;
    if given::is_given(config) {
        given::begin(config, six_step, state);
    }
}

/// The set-point as seen along the rotation.
fn demand(setpoint: Setpoint, reversed: bool) -> Demand {
    let along = if reversed {
        setpoint.turned()
    } else {
        setpoint
    };
    match along {
        Setpoint::Speed(speed) if speed > Speed::ZERO => Demand::Speed(speed),
        Setpoint::Voltage(share) if share > I1F31::ZERO => Demand::Share(share),
        Setpoint::Torque(current) | Setpoint::Test(current) => Demand::Current(current),
        _ => Demand::Rest,
    }
}

/// What follows when there is nothing left to slow down.
fn end(config: &super::Config, state: &mut super::State) {
    state.six_step.still = 0;
    launch::end(config, state);
}

/// Speed is regulated from the speed and the duty that there are.
fn run_from_here(state: &mut super::State) {
    let s = &mut state.six_step;
    s.planner = planner::State::begin(s.tracking.omega_bar);
    duty::take_over(&mut state.six_step.duty);
}

/// Ramp, Run and Stopping: from the crossing to the commutation, and the duty.
fn turn(
    config: &super::Config,
    six_step: &Config,
    state: &mut super::State,
    (sample, currents): (&Sample, [AdcCounts; 3]),
    setpoint: Setpoint,
) -> Bridge {
    let currents = in_order(config, state, currents);
    let terminals = in_order(config, state, sample.terminals);
    let ramp_current = start::current(six_step, state, setpoint);
    let ramping = state.phase == Phase::Ramp;
    let s = &mut state.six_step;
    let legs = s.sector.legs(currents);
    // The leg that was on before the last commutation carries all of the current, the other one
    // only what the released phase has left.
    let i = if s.sector.rising() {
        turn::reading(legs.switching)
    } else {
        turn::reading(legs.low).saturating_neg()
    };

    if given::is_given(config) {
        given::follow(config, six_step, state);
    } else if !crossings(six_step, state, terminals, ramping) {
        return start::lost(six_step, state);
    }
    let s = &mut state.six_step;

    if ramping {
        hold(six_step, s, i, ramp_current);
        if s.tracking.crossings >= KNOWN && s.tracking.omega_bar >= six_step.run_speed {
            s.tracking.acceleration = Speed::ZERO;
            state.phase = Phase::Run;
            run_from_here(state);
        }
    } else {
        run(config, six_step, state, i, setpoint);
    }
    let bridge = turn_on(config, state, currents, i);
    let slow = !ramping && state.six_step.tracking.omega_bar < six_step.slow;
    match state.phase {
        Phase::Stopping if slow => {
            end(config, state);
            match config.stop {
                Stop::Coast => Bridge::Off,
                Stop::Brake => Bridge::Brake,
            }
        }
        Phase::Run if slow && given::is_given(config) => {
            if given::slow(config, state) {
                Bridge::Off
            } else {
                bridge
            }
        }
        Phase::Run if slow => start::lost(six_step, state),
        Phase::Run if state.run_periods < config.proven_periods => {
            state.run_periods += 1;
            if state.run_periods == config.proven_periods {
                state.six_step.failed = 0;
            }
            bridge
        }
        _ => bridge,
    }
}

/// Looks for the crossing and commutates by it. False where the rotor is no longer followed.
#[inline]
fn crossings(
    six_step: &Config,
    state: &mut super::State,
    terminals: [AdcCounts; 3],
    ramping: bool,
) -> bool {
    let s = &mut state.six_step;
    s.tracking.advance();
    let terminal = s.sector.legs(terminals).floating;
    let terminal = six_step.terminal.held(terminal);
    let rising = s.sector.rising();
    let found = crossing::look(
        &six_step.crossing,
        &mut s.crossing,
        rising,
        ramping,
        s.tracking.certain(),
        terminal,
        state.protection.bus,
    );
    if let Some(age) = found {
        s.tracking.crossed(age);
        s.missed = 0;
    }
    commutate(six_step, s, ramping);
    s.astray = if ramping && s.tracking.crossings < KNOWN {
        s.astray.saturating_add(1)
    } else {
        0
    };
    s.missed < LOST_SEXTANTS && s.astray < six_step.astray
}

/// The next sextant, where it is time.
fn commutate(six_step: &Config, s: &mut State, ramping: bool) {
    let blind = s.crossing.blind();
    let mut sextants = 1;
    let due = if s.crossing.found || blind {
        // Where nothing has been seen, the released phase's current has hidden the crossing, or the
        // rotor had been past it: what is known of it tells when the sextant ends.
        s.tracking.reaches(HALF_SEXTANT, six_step.delay)
    } else if ramping {
        // It is certain to be on its way, pulled forwards, unless something holds it.
        sextants = IMPATIENCE;
        s.crossing.samples >= six_step.patience
    } else {
        s.tracking.reaches(SEXTANT, six_step.delay)
    };
    if !due {
        return;
    }
    if s.crossing.found || (blind && s.tracking.crossings > 0) {
        s.tracking.commutated();
    } else {
        s.tracking.forced();
    }
    if !s.crossing.found {
        s.missed += sextants;
    }
    s.sector = s.sector.next();
    s.crossing.begin(&six_step.crossing);
}

/// Run and Stopping: the duty.
fn run(
    config: &super::Config,
    six_step: &Config,
    state: &mut super::State,
    i: Current,
    setpoint: Setpoint,
) {
    let bounds = state.protection.bounds;
    let reversed = state.reversed;
    let s = &mut state.six_step;
    let bounds = Bounds {
        min: bounds.min.max(-six_step.braking),
        max: bounds.max.minus(s.duty.ripple()).max(bounds.max / 2),
    };
    let steady = |current: Current| {
        let held = current.min(bounds.max).max(bounds.min);
        Bounds {
            min: held,
            max: held,
        }
    };
    match demand(setpoint, reversed) {
        Demand::Speed(command) => {
            let step = s.planner.plan(&six_step.planner, command);
            s.planner.advance(step);
            let reference = s.planner.reference;
            let range = duty::range(&six_step.duty, &mut s.duty, i, bounds);
            let error = reference.saturating_sub(s.tracking.omega_bar);
            duty::speed(&six_step.duty, &mut s.duty, error, range);
            return;
        }
        Demand::Share(share) => {
            let range = duty::range(&six_step.duty, &mut s.duty, i, bounds);
            let share = I1F31::from_bits(share.top(six_step.duty.duty_max).to_bits() << 1);
            duty::share(&mut s.duty, share, range);
        }
        Demand::Current(current) => regulate(six_step, s, i, steady(current)),
        Demand::Rest => {
            // A current of none is one of some mA: what a shaft without a load gains by it is taken
            // back.
            let slowest = s.planner.reference.min(s.tracking.omega_bar);
            let gained = s.tracking.omega_bar.saturating_sub(slowest) > slowest / GAINED_PART;
            let current = match config.stop {
                Stop::Coast => Current::ZERO,
                Stop::Brake => bounds.min,
            };
            let current = if gained {
                current.min(turn::reading(NO_CURRENT).saturating_neg())
            } else {
                current
            };
            let held = Bounds {
                min: current,
                max: current,
            };
            regulate(six_step, s, i, held);
            s.planner = planner::State::begin(slowest);
            duty::take_over(&mut s.duty);
            return;
        }
    }
    s.planner = planner::State::begin(s.tracking.omega_bar);
    duty::take_over(&mut s.duty);
}

/// Regulates the current.
fn regulate(six_step: &Config, s: &mut State, i: Current, bounds: Bounds) {
    let range = duty::range(&six_step.duty, &mut s.duty, i, bounds);
    duty::current(&mut s.duty, range);
}

/// Regulates the current of the start.
fn hold(six_step: &Config, s: &mut State, i: Current, wanted: Current) {
    let bounds = Bounds {
        min: wanted,
        max: wanted,
    };
    regulate(six_step, s, i, bounds);
}

/// The bridge of the present sextant.
fn turn_on(
    config: &super::Config,
    state: &mut super::State,
    currents: [AdcCounts; 3],
    i: Current,
) -> Bridge {
    let s = &state.six_step;
    let phases = s.sector.phases(Legs {
        switching: Some(s.duty.for_bridge()),
        low: Some(Duty::ZERO),
        floating: None,
    });
    tell::tell(config, state, currents, i);
    Bridge::Legs(in_order(config, state, phases))
}

/// Phases b and c change places where the motor turns the other way than a, b, c.
fn in_order<T>(config: &super::Config, state: &super::State, phases: [T; 3]) -> [T; 3] {
    turn::in_order(state.swapped(config), phases)
}

#[cfg(test)]
mod tests;
