//! Idle and Sense: the bridge is off, and the open terminals show the rotor.
//!
//! A start begins with a few milliseconds in which the current offsets are measured and the rotor is searched for.
//! The field-oriented drive catches a turning rotor where it is, stops one that turns the other way first, follows a
//! slow one, and parks a standing one. Six-step seeks the rotor by turning it.

use siskin_units::{Speed, traced};

use super::config::{Config, Direction};
use super::io::Sample;
use super::shared::Shared;
use super::transitions::Why;
use crate::control::catch::{self, Rotor};
use crate::control::sensing::{self, Zeroing};
use crate::protection::Fault;

/// Offset measurements without knowing whether the rotor turns: after eight times 5 ms it is too slow to matter, or
/// its terminals cannot be read.
const MEASUREMENTS_MAX: u8 = 8;

/// The sample at which the bridge turns off, and one for a period of delay.
const SETTLING_PERIODS: u8 = 2;

traced! {
    /// State while the bridge is off.
    #[derive(Clone, Debug, PartialEq)]
    pub(super) struct State {
        /// Samples that may still show current from before the bridge was off.
        settling_periods: u8,
        /// Offset measurements since Sense began.
        offset_measurements: u8,
        /// The rotor, from the open terminals, for the phase order a, b, c.
        pub(super) rotor: Rotor,
        catch: catch::State,
    }
}

impl State {
    /// Creates the state in which nothing is known.
    pub(super) fn new(config: &Config) -> Self {
        Self {
            settling_periods: 0,
            offset_measurements: 0,
            rotor: Rotor::Unknown,
            catch: catch::State::new(&config.catch),
        }
    }

    /// Begins Sense: nothing is measured yet.
    pub(super) fn begin(&mut self) {
        self.settling_periods = SETTLING_PERIODS;
        self.offset_measurements = 0;
    }

    /// Returns true if this period compares a tracked rotor with its prediction; the next one does not.
    pub(super) fn is_compare_due(&self) -> bool {
        self.catch.is_compare_due()
    }

    /// Returns true if this period is to check a tracked rotor's fit, and no more.
    pub(super) fn does_little(&self) -> bool {
        self.catch.is_check_due()
    }

    /// Returns true if the firmware's own work fits behind what this period has done.
    pub(super) fn has_done_little(&self) -> bool {
        self.catch.has_corrected()
    }

    /// Forgets the rotor: the terminals have been driven since.
    pub(super) fn forget(&mut self) {
        self.rotor = Rotor::Unknown;
        self.catch.restart();
    }
}

/// Watches the rotor at the open terminals. Ignores the currents: a reading is its offset, which may not be
/// measured yet.
#[inline(never)] // only some periods
pub(super) fn watch(config: &Config, state: &mut State, shared: &mut Shared, sample: &Sample) {
    state.rotor = catch::observe(&config.catch, &mut state.catch, sample.terminals);
    match state.rotor {
        Rotor::Unknown => shared.coast(config),
        Rotor::Standing => shared.seen.speed = Speed::ZERO,
        Rotor::Turning { theta, omega } => {
            shared.reversed = omega.is_negative() != (config.direction == Direction::Reversed);
            shared.seen.speed = omega.saturating_abs();
            shared.seen.angle = theta;
        }
    }
}

/// Runs Sense until the current offsets and the rotor are known.
pub(super) fn sense(
    config: &Config,
    state: &mut State,
    shared: &mut Shared,
    sample: &Sample,
) -> Option<Why> {
    watch(config, state, shared, sample);
    if state.settling_periods > 0 {
        state.settling_periods -= 1;
        return None;
    }
    match sensing::zero(&config.sensing, &mut shared.zeros, sample.currents) {
        Zeroing::Measuring => None,
        Zeroing::Defect => Some(Why::Tripped(Fault::CurrentSensor)),
        Zeroing::Done => {
            state.offset_measurements += 1;
            let known =
                state.rotor != Rotor::Unknown || state.offset_measurements >= MEASUREMENTS_MAX;
            known.then_some(Why::Sensed)
        }
    }
}
