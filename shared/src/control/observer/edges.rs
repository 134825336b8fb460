//! The second paper's position estimation as the drive calls it (figures 16 and 25): flux observers,
//! their comparator and Hall sensors, each of which gives edges, and the estimator that they trigger.
//!
//! Forwards only: for the other direction the drive exchanges the phases b and c of all that goes in.

use super::crossing::{self, Crossing};
use super::flux_linkage;
use super::hall::{self, Step};
use super::position::{self, Periods};
use crate::trace::traced;
use crate::units::{Angle, Current, Speed, Voltage};

/// The source of the edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sensors {
    /// Flux crossings; there are no Hall sensors.
    #[default]
    None,
    /// Hall sensors alone; neither voltages nor currents are looked at.
    Hall,
    /// Hall sensors at standstill and low speed, flux crossings above; and in place of sensors that
    /// have failed.
    Merged,
}

/// The estimation's coefficients.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// The source of the edges.
    pub sensors: Sensors,
    /// Flux observers.
    pub flux: flux_linkage::Config,
    /// Comparator.
    pub crossing: crossing::Config,
    /// Position estimator.
    pub position: position::Config,
    /// Hall sensors.
    pub hall: hall::Config,
    /// Speed above which flux crossings take over from Hall sensors.
    pub flux_above: Speed,
    /// Speed below which Hall sensors take over again.
    pub hall_below: Speed,
}

traced! {
    /// The present trigger of the position estimator.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    #[repr(u8)]
    pub enum Source {
        /// Hall sensors.
        #[default]
        Hall,
        /// Flux crossings.
        Flux,
    }
}

traced! {
    /// The estimation's state.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// The trigger of the position estimator.
        pub source: Source,
        /// Flux observers.
        pub flux: flux_linkage::State,
        /// Comparator.
        pub crossing: crossing::State,
        /// Position estimator.
        pub position: position::State,
        /// Hall sensors.
        pub hall: hall::State,
    }
}

/// The estimate of the rotor at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// θ̂ at this sample.
    pub theta: Angle,
    /// ω̂.
    pub omega: Speed,
    /// Its change in a period, by the last measurement.
    pub omega_step: Speed,
    /// True if the position is known; if not, the rest is the last that was.
    pub known: bool,
    /// True if a Hall sensor is at fault.
    pub sensor_fault: bool,
}

/// One period: the mean phase voltages since the last sample (star, their sum zero), the currents at
/// this one, and the Hall sensors in bits 0, 1, 2 for the phases a, b, c, high while the rotor's flux
/// through the phase is positive.
pub fn estimate(
    config: &Config,
    state: &mut State,
    v: [Voltage; 3],
    i: [Current; 3],
    hall: u8,
) -> Position {
    position::advance(&mut state.position);
    let step = match config.sensors {
        Sensors::None => None,
        Sensors::Hall | Sensors::Merged => hall::read(&config.hall, &mut state.hall, hall),
    };
    let crossing = match config.sensors {
        Sensors::Hall => None,
        Sensors::None | Sensors::Merged => observe(config, state, v, i),
    };
    choose(config, state);
    match (state.source, step, crossing) {
        (Source::Hall, Some(step), _) => sensed(config, state, step),
        (Source::Flux, _, Some(crossing)) => crossed(config, state, &crossing),
        _ => {}
    }
    if state.source == Source::Hall {
        rest(config, state);
    }
    position(state)
}

/// Fluxes and their comparator; crossings that the Hall sensors should have seen.
fn observe(
    config: &Config,
    state: &mut State,
    v: [Voltage; 3],
    i: [Current; 3],
) -> Option<Crossing> {
    let State {
        flux,
        crossing,
        position,
        hall,
        ..
    } = state;
    flux_linkage::advance(&config.flux, flux, v, i);
    let found = crossing::detect(
        &config.crossing,
        crossing,
        &flux.lambda_before,
        &flux.lambda,
        flux.amplitude,
        position.omega,
    )?;
    flux_linkage::adapt(&config.flux, flux, found.amplitude);
    if crossing.trusted()
        && position.omega >= config.hall_below
        && let Some(sensed) = hall.sector
        && matches!(sensed.steps_to(found.sector), 2..=4)
    {
        hall::contradict(hall);
    }
    Some(found)
}

/// Chooses the source: by the sensors that there are and, where both are, by the speed.
fn choose(config: &Config, state: &mut State) {
    let omega = state.position.omega;
    let wanted = match (config.sensors, state.source) {
        (Sensors::None, _) => Source::Flux,
        (Sensors::Hall, _) => Source::Hall,
        (Sensors::Merged, _) if state.hall.fault => Source::Flux,
        (Sensors::Merged, Source::Hall) => {
            let ready = omega >= config.flux_above && state.crossing.trusted();
            if ready { Source::Flux } else { Source::Hall }
        }
        (Sensors::Merged, Source::Flux) => {
            let keeps = omega >= config.hall_below && state.crossing.tracks;
            if keeps { Source::Flux } else { Source::Hall }
        }
    };
    if wanted != state.source {
        state.source = wanted;
        position::retime(&mut state.position);
    }
}

/// An edge of the flux.
fn crossed(config: &Config, state: &mut State, crossing: &Crossing) {
    position::time(&config.position, &mut state.position, crossing.late);
    // λ̂ leads the rotor's flux, so that it crosses zero early; the deadband is crossed late.
    let lead = flux_linkage::lead(&config.flux, state.position.omega);
    let ahead = config.crossing.deadband_angle.wrapping_sub(lead);
    position::place(
        &config.position,
        &mut state.position,
        crossing.sector,
        ahead,
    );
}

/// A change of the Hall sensors' code.
fn sensed(config: &Config, state: &mut State, step: Step) {
    let position = &mut state.position;
    match step {
        Step::Found(sector) | Step::Back(sector) => position::stand(position, sector),
        Step::Jump(sector) => position::settle(position, sector.middle()),
        Step::Forward(sector) => {
            position::time(&config.position, position, HALL_LATE);
            position::place(&config.position, position, sector, Angle::ZERO);
        }
    }
}

/// Delay until a Hall edge is seen: half a period in the mean, and what its code must last beyond the
/// first sample.
const HALL_LATE: Periods = Periods::from_bits((2 * hall::SAMPLES - 1) << (Periods::FRAC_NBITS - 1));

/// Without edges for long the rotor stands, somewhere in its sector.
fn rest(config: &Config, state: &mut State) {
    let position = &mut state.position;
    if position.since >= config.crossing.patience
        && position.omega > Speed::ZERO
        && let Some(sector) = state.hall.believed()
    {
        position::stand(position, sector);
    }
}

fn position(state: &State) -> Position {
    let position = &state.position;
    Position {
        theta: position.theta,
        omega: position.omega,
        omega_step: position.omega_step,
        known: match state.source {
            Source::Flux => state.crossing.tracks,
            Source::Hall => state.hall.believed().is_some(),
        },
        sensor_fault: state.hall.fault,
    }
}

/// Begins at this angle and speed with these currents. What is known of the sensors stays.
pub fn begin(config: &Config, state: &mut State, theta: Angle, omega: Speed, i: [Current; 3]) {
    position::begin(&mut state.position, theta, omega);
    flux_linkage::begin(&config.flux, &mut state.flux, theta, omega, i);
    let lead = flux_linkage::lead(&config.flux, omega);
    crossing::begin(&mut state.crossing, theta.wrapping_add(lead));
    state.source = match config.sensors {
        Sensors::Merged if omega < config.flux_above && !state.hall.fault => Source::Hall,
        Sensors::Hall => Source::Hall,
        Sensors::None | Sensors::Merged => Source::Flux,
    };
}

/// The rotor stands in the sector that the Hall sensors show. False where they cannot be believed.
pub fn stand(config: &Config, state: &mut State, hall: u8) -> bool {
    if config.sensors == Sensors::None {
        return false;
    }
    let Some(sector) = hall::look(&mut state.hall, hall) else {
        return false;
    };
    position::stand(&mut state.position, sector);
    true
}

/// The rotor's angle at the coming sample, if crossings are followed.
pub fn found(state: &State) -> Option<Angle> {
    let position = &state.position;
    let known = state.crossing.tracks && position.omega.is_positive();
    known.then(|| position.theta.wrapping_add(position.omega.over_period()))
}

impl State {}

#[cfg(test)]
mod tests;
