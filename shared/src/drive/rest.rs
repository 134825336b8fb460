//! The bridge is off, or only charges its drivers: what is done before the phases switch.
//!
//! A start begins with a few milliseconds in which the currents' zeros are measured and the rotor is
//! looked for at the open terminals. One that turns is caught where it is; one that turns the other
//! way is stopped first; one that stands is parked.

use super::{Bridge, Config, Direction, Fault, Phase, Sample, Setpoint, State, tone};
use crate::control::catch::{self, Rotor};
use crate::control::sensing::{self, Zeroing};
use crate::units::{AdcCounts, Speed};

/// How often the currents' zeros are measured anew while it is not known whether the rotor turns:
/// after eight times 5 ms it turns too slowly to matter, or its terminals cannot be read.
const LOOKS: u8 = 8;

/// A period of Idle, Sense, Charge or Tone. `None` when Charge is done and the motor is to turn, and
/// in any other phase: then the drive acts.
#[inline(always)]
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
pub(super) fn watch(config: &Config, state: &mut State, sample: &Sample) {
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
                state.charge_periods = 0;
            }
        }
    }
}

/// Charge: the low sides supply the drivers, and the rotor turns on unseen. False when it is done.
fn charge(config: &Config, state: &mut State) -> bool {
    if let Rotor::Turning { theta, omega } = &mut state.rotor {
        *theta = theta.wrapping_add(*omega);
        state.seen.angle = *theta;
    }
    state.charge_periods += 1;
    state.charge_periods <= config.charge.periods
}
