//! The pieces of the outer loop, each in a period of its own.

use siskin_units::{AdcCounts, Current};

use super::state::{Piece, State};
use super::{duty, telemetry};
use crate::drive::config;
use crate::drive::config::six_step::Config;
use crate::drive::io::Setpoint;
use crate::drive::phase::Phase;
use crate::drive::shared::Shared;
use crate::drive::transitions::Why;

/// Runs the piece that is due, if any; returns the mode change that the set-point asks for.
pub(super) fn run(
    config: &config::Config,
    six_step: &Config,
    (s, shared): (&mut State, &mut Shared),
    setpoint: &Setpoint,
    readings: ([AdcCounts; 3], Current),
) -> Option<Why> {
    let phase = shared.seen.phase;
    match s.take_due()? {
        Piece::Mode => return mode_change(config, shared, phase, setpoint),
        Piece::Demand => {
            if matches!(phase, Phase::Run | Phase::Stopping) {
                duty::plan(config, six_step, (s, shared), setpoint);
            }
        }
        Piece::Seen => telemetry::see(s, shared, readings),
        Piece::Supply => telemetry::supply(config, s, shared, readings.1),
    }
    None
}

/// Returns the mode change that a set-point asks for while this drive drives.
fn mode_change(
    config: &config::Config,
    shared: &mut Shared,
    phase: Phase,
    setpoint: &Setpoint,
) -> Option<Why> {
    let is_to_stop = duty::is_to_stop(setpoint, shared.reversed);
    match phase {
        Phase::Stopping if !is_to_stop => Some(Why::Resumed),
        Phase::Run if is_to_stop => Some(Why::Released),
        Phase::Ramp if !shared.is_along(config, setpoint) => {
            shared.failed_starts = 0;
            Some(Why::Released)
        }
        _ => None,
    }
}
