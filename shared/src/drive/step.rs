//! The control period.

use super::{Bridge, Config, Direction, Faults, Phase, Sample, Setpoint, State};
use super::{launch, rest, six_step, turn};
use crate::control::delay::Delay;
use crate::control::sensing;
use crate::protection;
use crate::units::{AdcCounts, Duty};

/// One control period: from the sample to what the bridge does in the period that follows.
///
/// Pure: no clock, no allocation, no logging, and no result but the state and the returned value.
/// Called once a PWM period, in the interrupt of the chip and in the emulator's loop.
pub fn step(config: &Config, state: &mut State, sample: Sample, setpoint: Setpoint) -> Bridge {
    let currents = sensing::currents(
        &config.sensing,
        &state.sensing,
        sample.currents,
        state.duties(config.delay),
    );
    let bus = config.bus.saturating_apply(sample.bus);
    // With the bridge off a reading is its offset, which may not have been measured yet.
    let off = matches!(state.phase, Phase::Idle | Phase::Sense);
    let flowing = (!off).then_some(currents);
    let found = protection::check(&config.protection, &mut state.protection, flowing, bus);
    if let Some(fault) = found {
        state.trip(fault);
    }
    if let Setpoint::Fault(fault) = setpoint {
        state.trip(fault);
    }
    // None, until the phases are told to switch.
    state.applied = [[Duty::ZERO; 3], state.applied[0]];
    if state.faults.is_empty() {
        healthy(config, state, &sample, currents, setpoint)
    } else {
        latched(config, state, &sample, setpoint)
    }
}

/// A period without a fault.
#[inline(always)]
fn healthy(
    config: &Config,
    state: &mut State,
    sample: &Sample,
    currents: [AdcCounts; 3],
    setpoint: Setpoint,
) -> Bridge {
    if let Some(six_step) = &config.six_step {
        return six_step::period(config, six_step, state, sample, currents, setpoint);
    }
    launch::follow(config, state, setpoint);
    state.seen.phase = state.phase;
    if let Some(bridge) = rest::period(config, state, sample, (currents, setpoint)) {
        return bridge;
    }
    if state.phase == Phase::Charge {
        launch::begin(config, state, sample, setpoint);
    }
    if state.phase == Phase::Brake {
        turn::watch(config, state, sample, currents);
        return Bridge::Brake;
    }
    turn::period(config, state, sample, currents, setpoint)
}

/// A fault ends when zero throttle has stood for a while without its cause: the tasks have seen it
/// by then, and a limit that is grazed does not come and go.
#[cold]
fn latched(config: &Config, state: &mut State, sample: &Sample, setpoint: Setpoint) -> Bridge {
    rest::watch(config, state, sample);
    if setpoint != Setpoint::Zero {
        state.clear_periods = 0;
    } else if state.clear_periods < config.clear_periods {
        state.clear_periods += 1;
    } else {
        state.faults = Faults::NONE;
        state.failed_starts = 0;
    }
    Bridge::Off
}

impl Setpoint {
    /// The same as seen by a motor that turns the other way.
    pub(super) fn turned(self) -> Self {
        match self {
            Self::Speed(speed) => Self::Speed(speed.saturating_neg()),
            Self::Torque(current) => Self::Torque(current.saturating_neg()),
            Self::Voltage(share) => Self::Voltage(share.saturating_neg()),
            Self::Test(current) => Self::Test(current.saturating_neg()),
            Self::Stop | Self::Zero | Self::Fault(_) | Self::Tone(_) => self,
        }
    }
}

impl State {
    /// Whether phases b and c change places for the control, which always turns one way.
    pub(super) fn swapped(&self, config: &Config) -> bool {
        (config.direction == Direction::Reversed) != self.reversed
    }

    /// The duties of the period that has elapsed at this sample.
    #[inline(always)]
    fn duties(&self, delay: Delay) -> [Duty; 3] {
        self.applied[usize::from(delay == Delay::One)]
    }
}
