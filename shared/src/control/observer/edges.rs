//! The second paper's position estimation as the drive calls it (figures 16 and 25): flux observers, their
//! comparator and Hall sensors, which produce edges, and the estimator that the edges trigger.
//!
//! Forward rotation only: for the other direction the drive swaps phases b and c in all inputs.

use siskin_params::parts;
use siskin_units::{Angle, Current, Speed, Voltage, traced};

use super::crossing::{self, Crossing};
use super::flux_linkage;
use super::hall::{self, Step};
use super::position::{self, Periods};

/// The source of the edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensors {
    /// Flux crossings; no Hall sensors.
    None(parts::FluxCrossings),
    /// Hall sensors alone; voltages and currents are ignored.
    Hall(parts::Hall),
    /// Hall sensors at standstill and low speed, flux crossings above, which also replace failed sensors.
    Merged(parts::Hall, parts::FluxCrossings),
}

/// Coefficients of the estimation.
#[derive(Clone, Debug, PartialEq)]
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
    /// Speed above which flux crossings take over from the Hall sensors.
    pub flux_above: Speed,
    /// Speed below which the Hall sensors take over again.
    pub hall_below: Speed,
}

impl Config {
    /// Creates it without coefficients.
    pub fn new(sensors: Sensors) -> Self {
        Self {
            sensors,
            flux: flux_linkage::Config::default(),
            crossing: crossing::Config::default(),
            position: position::Config::default(),
            hall: hall::Config::default(),
            flux_above: Speed::ZERO,
            hall_below: Speed::ZERO,
        }
    }
}

traced! {
    /// What triggers the position estimator.
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
    /// State of the estimation.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// The position estimator's trigger.
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

/// The rotor estimate at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// θ̂ at this sample.
    pub theta: Angle,
    /// ω̂.
    pub omega: Speed,
    /// Change of ω̂ per period, by the last measurement.
    pub omega_step: Speed,
    /// The position is known; otherwise the other fields hold the last known one.
    pub known: bool,
    /// A Hall sensor has failed.
    pub sensor_fault: bool,
}

/// Runs one period on the mean phase voltages since the last sample (star, summing to zero), the currents at this
/// one, and the Hall sensors in bits 0, 1, 2 for phases a, b, c, high while the rotor's flux through the phase is
/// positive.
pub fn estimate(
    config: &Config,
    state: &mut State,
    v: [Voltage; 3],
    i: [Current; 3],
    hall: u8,
) -> Position {
    position::advance(&mut state.position);
    let step = match config.sensors {
        Sensors::None(_) => None,
        Sensors::Hall(_) | Sensors::Merged(..) => hall::read(&config.hall, &mut state.hall, hall),
    };
    let crossing = match config.sensors {
        Sensors::Hall(_) => None,
        Sensors::None(_) | Sensors::Merged(..) => flux_crossing(config, state, v, i),
    };
    select_source(config, state);
    match (state.source, step, crossing) {
        (Source::Hall, Some(step), _) => hall_edge(config, state, step),
        (Source::Flux, _, Some(crossing)) => flux_edge(config, state, &crossing),
        _ => {}
    }
    if state.source == Source::Hall {
        rest_without_edges(config, state);
    }
    estimated_position(state)
}

/// Runs the flux observers and their comparator; checks crossings against the Hall sensors.
fn flux_crossing(
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
        && let Some(hall_sector) = hall.sector
        && matches!(hall_sector.steps_to(found.sector), 2..=4)
    {
        hall::contradict(hall);
    }
    Some(found)
}

/// Selects the source by the available sensors and, with both, by speed.
fn select_source(config: &Config, state: &mut State) {
    let omega = state.position.omega;
    let wanted = match (config.sensors, state.source) {
        (Sensors::None(_), _) => Source::Flux,
        (Sensors::Hall(_), _) => Source::Hall,
        (Sensors::Merged(..), _) if state.hall.fault => Source::Flux,
        (Sensors::Merged(..), Source::Hall) => {
            let ready = omega >= config.flux_above && state.crossing.trusted();
            if ready { Source::Flux } else { Source::Hall }
        }
        (Sensors::Merged(..), Source::Flux) => {
            let keeps = omega >= config.hall_below && state.crossing.tracks;
            if keeps { Source::Flux } else { Source::Hall }
        }
    };
    if wanted != state.source {
        state.source = wanted;
        position::restart_timing(&mut state.position);
    }
}

/// Handles a flux edge.
fn flux_edge(config: &Config, state: &mut State, crossing: &Crossing) {
    position::time_edge(&config.position, &mut state.position, crossing.late);
    // λ̂ leads the rotor's flux and so crosses zero early; the deadband makes it late.
    let lead = flux_linkage::lead(&config.flux, state.position.omega);
    let ahead = config.crossing.deadband_angle.wrapping_sub(lead);
    position::place_at_edge(
        &config.position,
        &mut state.position,
        crossing.sector,
        ahead,
    );
}

/// Handles a change of the Hall code.
fn hall_edge(config: &Config, state: &mut State, step: Step) {
    let position = &mut state.position;
    match step {
        Step::Found(sector) | Step::Back(sector) => position::set_to_rest(position, sector),
        Step::Jump(sector) => position::set_angle(position, sector.middle()),
        Step::Forward(sector) => {
            position::time_edge(&config.position, position, HALL_LATE);
            position::place_at_edge(&config.position, position, sector, Angle::ZERO);
        }
    }
}

/// Delay until a Hall edge is seen: half a period on average, plus the samples beyond the first that its code must
/// last.
const HALL_LATE: Periods = Periods::from_bits((2 * hall::SAMPLES - 1) << (Periods::FRAC_NBITS - 1));

/// After a long time without edges, sets the rotor to rest somewhere in its sector.
fn rest_without_edges(config: &Config, state: &mut State) {
    let position = &mut state.position;
    if position.since >= config.crossing.patience
        && position.omega > Speed::ZERO
        && let Some(sector) = state.hall.trusted_sector()
    {
        position::set_to_rest(position, sector);
    }
}

fn estimated_position(state: &State) -> Position {
    let position = &state.position;
    Position {
        theta: position.theta,
        omega: position.omega,
        omega_step: position.omega_step,
        known: match state.source {
            Source::Flux => state.crossing.tracks,
            Source::Hall => state.hall.trusted_sector().is_some(),
        },
        sensor_fault: state.hall.fault,
    }
}

/// Begins at this angle and speed with these currents. Keeps what is known of the sensors.
pub fn begin(config: &Config, state: &mut State, theta: Angle, omega: Speed, i: [Current; 3]) {
    position::begin(&mut state.position, theta, omega);
    flux_linkage::begin(&config.flux, &mut state.flux, theta, omega, i);
    let lead = flux_linkage::lead(&config.flux, omega);
    crossing::begin(&mut state.crossing, theta.wrapping_add(lead));
    state.source = match config.sensors {
        Sensors::Merged(..) if omega < config.flux_above && !state.hall.fault => Source::Hall,
        Sensors::Hall(_) => Source::Hall,
        Sensors::None(_) | Sensors::Merged(..) => Source::Flux,
    };
}

/// Sets the rotor to rest in the sector that the Hall sensors show. Returns false if they cannot be trusted.
pub fn begin_at_rest(config: &Config, state: &mut State, hall: u8) -> bool {
    if matches!(config.sensors, Sensors::None(_)) {
        return false;
    }
    let Some(sector) = hall::read_at_rest(&mut state.hall, hall) else {
        return false;
    };
    position::set_to_rest(&mut state.position, sector);
    true
}

/// Returns the rotor's angle at the next sample, if crossings are tracked.
pub fn locked_angle(state: &State) -> Option<Angle> {
    let position = &state.position;
    let known = state.crossing.tracks && position.omega.is_positive();
    known.then(|| position.theta.wrapping_add(position.omega.over_period()))
}

#[cfg(test)]
mod tests;
