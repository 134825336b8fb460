//! The mode change that a set-point asks for.

use siskin_units::Speed;

use super::config::{Config, Stop};
use super::foc::{begin, brake};
use super::io::{Rotation, Setpoint};
use super::phase::Phase;
use super::shared::Shared;
use super::six_step;
use super::state::State;
use super::transitions::Why;
use crate::control::catch::Rotor;

/// Returns the reason why the present mode ends, if the set-point asks for another.
pub(super) fn mode_change(config: &Config, state: &mut State, setpoint: &Setpoint) -> Option<Why> {
    match (state.phase, &config.six_step) {
        (Phase::Idle | Phase::Sense | Phase::Charge | Phase::Brake | Phase::Tone, _) => {
            at_rest(config, state, setpoint)
        }
        (phase, None) => driving(config, &mut state.shared, phase, setpoint),
        // It decides in a period of its own.
        (_, Some(_)) => None,
    }
}

/// While field-oriented control drives.
#[inline(always)] // in the longest period
fn driving(config: &Config, shared: &mut Shared, phase: Phase, setpoint: &Setpoint) -> Option<Why> {
    if shared.is_along(config, setpoint) {
        return (phase == Phase::Stopping).then_some(Why::Resumed);
    }
    if phase.is_open_loop() {
        shared.failed_starts = 0;
        return Some(Why::Released);
    }
    // A torque against the rotation slows the motor down within Run but does not reverse it.
    if matches!(setpoint, Setpoint::Torque(_) | Setpoint::Test(_))
        && shared.seen.speed >= config.slow
    {
        return None;
    }
    if config.stop == Stop::Coast && setpoint.rotation(config.both_ways) == Rotation::Rest {
        // Bridge off at once: without current the terminals show how the shaft turns.
        return Some(Why::Coasts);
    }
    (phase == Phase::Run).then_some(Why::Released)
}

/// Handles set-points while nothing drives.
#[inline(never)] // not in field-oriented control's periods
fn at_rest(config: &Config, state: &mut State, setpoint: &Setpoint) -> Option<Why> {
    let pulls = matches!(setpoint, Setpoint::Pull(_));
    let wants_tone = match setpoint {
        Setpoint::Pull(_) | Setpoint::Excite(_) => true,
        Setpoint::Tone(_) => config.tone.is_some(),
        _ => false,
    };
    let drives = setpoint.rotation(config.both_ways) != Rotation::Rest;
    let stands = matches!(state.off.rotor, Rotor::Standing);
    match state.phase {
        Phase::Tone | Phase::Sense if wants_tone => None,
        // A test charges what it needs itself, and must find a short before all low sides turn on.
        Phase::Charge if pulls && stands => Some(Why::ToneReady),
        Phase::Charge if wants_tone && stands => None,
        Phase::Idle if wants_tone && stands => Some(Why::Tone),
        Phase::Brake if wants_tone && state.shared.seen.speed == Speed::ZERO => Some(Why::Tone),
        Phase::Tone if drives => Some(Why::Drive),
        Phase::Tone if state.tone.shorted_before => Some(Why::Shorted),
        Phase::Idle if state.tone.shorted_before && !drives && stands => Some(Why::Shorted),
        // Not the low sides: the rotor may turn, and is watched until it stands.
        Phase::Tone | Phase::Sense | Phase::Charge if !drives => Some(Why::Released),
        Phase::Idle | Phase::Brake if !drives => {
            state.shared.failed_starts = 0;
            None
        }
        phase => start(config, state, phase, setpoint),
    }
}

/// Handles a request to turn while nothing drives.
fn start(config: &Config, state: &mut State, phase: Phase, setpoint: &Setpoint) -> Option<Why> {
    // Else the drive that has just ended is not forgotten yet.
    let knows = !state.begins_rest();
    let shared = &mut state.shared;
    let begins = matches!(phase, Phase::Idle | Phase::Brake).then_some(Why::Drive);
    if let Some(six_step) = &config.six_step {
        let position = six_step::given::position(config, &state.foc.observer, shared);
        if !six_step::period::is_too_fast(config, six_step, shared, (position, setpoint)) {
            begins
        } else if begins.is_none() {
            Some(Why::TooFast)
        } else {
            None
        }
    } else if phase == Phase::Brake
        && shared.is_along(config, setpoint)
        && shared.seen.speed > config.slow
    {
        Some(Why::Resumed)
    } else if phase == Phase::Brake && knows && brake::knows(config, &state.foc, shared) {
        let omega = state.foc.loops.phase_order.speed(shared.seen.speed);
        let rotor = (shared.seen.angle, omega);
        begin::follow(config, &mut state.foc, shared, rotor, setpoint);
        Some(Why::Followed)
    } else {
        begins
    }
}
