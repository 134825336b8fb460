//! The bridge is off, or only charges its drivers: what is done before the phases switch.
//!
//! A start begins with a few milliseconds in which the currents' zeros are measured and the rotor is
//! looked for at the open terminals. One that turns is caught where it is; one that turns the other
//! way is stopped first; one that stands is parked.

use super::launch::{self, Wish};
use super::{Bridge, Config, Direction, Fault, Faults, Phase, Sample, Setpoint, State, tone};
use crate::control::catch::{self, Rotor};
use crate::control::sensing::{self, Zeroing};
use crate::protection;
use crate::units::{AdcCounts, Duty, Speed, Voltage};

/// How often the currents' zeros are measured anew while it is not known whether the rotor turns:
/// after eight times 5 ms it turns too slowly to matter, or its terminals cannot be read.
const LOOKS: u8 = 8;

/// Whether the bridge is off and stays so until something is asked for: with a fault, in Idle and in
/// Sense. The six-step drive has its own.
#[inline(always)]
pub(super) fn is_off(config: &Config, state: &State) -> bool {
    let rests = matches!(state.phase, Phase::Idle | Phase::Sense);
    !state.faults.is_empty() || rests && config.six_step.is_none()
}

/// A period with the bridge off. The currents are not looked at: a reading is its offset, which may
/// not have been measured yet.
#[inline(never)]
pub(super) fn off(
    config: &Config,
    state: &mut State,
    sample: &Sample,
    setpoint: Setpoint,
) -> Bridge {
    let bus = bus(config, sample);
    if let Some(fault) = protection::check(&config.protection, &mut state.protection, None, bus) {
        state.trip(fault);
    }
    if let Setpoint::Fault(fault) = setpoint {
        state.trip(fault);
    }
    state.applied = [[Duty::ZERO; 3]; 2];
    if !state.faults.is_empty() {
        watch(config, state, sample);
        clear(config, state, setpoint);
        return Bridge::Off;
    }
    if !goes_on(config, state, setpoint) {
        launch::follow(config, state, setpoint);
    }
    state.seen.phase = state.phase;
    match state.phase {
        Phase::Idle => watch(config, state, sample),
        Phase::Sense => sense(config, state, sample),
        // From the next period on.
        _ => {}
    }
    Bridge::Off
}

/// Whether the set-point asks for no other phase than Idle or Sense, whichever it is.
#[inline(always)]
fn goes_on(config: &Config, state: &mut State, setpoint: Setpoint) -> bool {
    if state.phase == Phase::Sense {
        return launch::wish(config, setpoint) != Wish::Rest;
    }
    stays(state, setpoint)
}

/// Whether Idle or Brake, which were asked for by nothing but rest, go on.
#[inline(always)]
pub(super) fn stays(state: &mut State, setpoint: Setpoint) -> bool {
    let nothing = matches!(setpoint, Setpoint::Stop | Setpoint::Zero) && !state.tone.braked;
    if nothing {
        state.failed_starts = 0;
    }
    nothing
}

/// A fault ends when zero throttle has stood for a while without its cause: the tasks have seen it
/// by then, and a limit that is grazed does not come and go.
#[inline(always)]
fn clear(config: &Config, state: &mut State, setpoint: Setpoint) {
    if setpoint != Setpoint::Zero {
        state.clear_periods = 0;
    } else if state.clear_periods < config.clear_periods {
        state.clear_periods += 1;
    } else {
        state.faults = Faults::NONE;
        state.failed_starts = 0;
    }
}

/// The supply's voltage at a sample.
#[inline(always)]
pub(super) fn bus(config: &Config, sample: &Sample) -> Voltage {
    config.bus.of(sample.bus).scaled()
}

/// A period of Idle, Sense, Charge or Tone. `None` when Charge is done and the motor is to turn, and
/// in any other phase: then the drive acts.
pub(super) fn period(
    config: &Config,
    state: &mut State,
    sample: &Sample,
    (currents, setpoint): ([AdcCounts; 3], Setpoint),
) -> Option<Bridge> {
    match state.phase {
        Phase::Idle => {
            watch(config, state, sample);
            Some(Bridge::Off)
        }
        Phase::Sense => {
            sense(config, state, sample);
            Some(Bridge::Off)
        }
        Phase::Charge => {
            if charge(config, state) {
                Some(Bridge::Charge(config.charge.duty))
            } else {
                tone::period(config, state, currents, setpoint)
            }
        }
        Phase::Tone => tone::period(config, state, currents, setpoint),
        _ => None,
    }
}

/// A period with the bridge off: the rotor is watched at the open terminals.
#[inline(never)]
fn watch(config: &Config, state: &mut State, sample: &Sample) {
    state.rotor = catch::observe(&config.catch, &mut state.catch, sample.terminals);
    match state.rotor {
        Rotor::Unknown => state.coast(config),
        Rotor::Standing => state.seen.speed = Speed::ZERO,
        Rotor::Turning { theta, omega } => {
            let backwards = omega.is_negative() != (config.direction == Direction::Reversed);
            state.reversed = backwards;
            state.seen.speed = omega.saturating_abs();
            state.seen.angle = theta;
        }
    }
}

/// Sense: the bridge is off until the currents' zeros and the rotor are known.
fn sense(config: &Config, state: &mut State, sample: &Sample) {
    watch(config, state, sample);
    if state.settling_periods > 0 {
        state.settling_periods -= 1;
        return;
    }
    match sensing::zero(&config.sensing, &mut state.sensing, sample.currents) {
        Zeroing::Measuring => {}
        Zeroing::Defect => state.trip(Fault::CurrentSensor),
        Zeroing::Done => {
            state.looks += 1;
            if state.rotor != Rotor::Unknown || state.looks >= LOOKS {
                state.phase = Phase::Charge;
                state.charge_periods = match state.rotor {
                    Rotor::Turning { .. } => config.charge.spared_periods,
                    Rotor::Unknown | Rotor::Standing => 0,
                };
            }
        }
    }
}

/// Charge: the low sides supply the drivers, and the rotor turns on unseen. False when it is done.
fn charge(config: &Config, state: &mut State) -> bool {
    if let Rotor::Turning { theta, omega } = &mut state.rotor {
        *theta = theta.wrapping_add(omega.over_period());
        state.seen.angle = *theta;
    }
    state.charge_periods += 1;
    state.charge_periods <= config.charge.periods
}
