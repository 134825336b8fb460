//! The control period, from top to bottom.

use siskin_units::AdcCounts;

use super::config::Config;
use super::foc::period::period;
use super::foc::{begin, brake, open_loop, outer_loop};
use super::io::{Bridge, Rotation, Sample, Setpoint};
use super::mode_change::mode_change;
use super::phase::Phase;
use super::schedule::{self, Work};
use super::state::State;
use super::transitions::Why;
use super::{charge, excite, off, self_test, six_step, tone};
use crate::protection::{self, Fault};

/// One control period: from the sample to what the bridge does in the next period.
///
/// Pure: no clock, no allocation, no logging, and no effect beyond the state and the returned value. Called once
/// per PWM period, by the chip's interrupt and the emulator's loop.
#[inline(always)] // in each period: sample, set-point and result would go through memory
pub fn step(config: &Config, state: &mut State, sample: Sample, setpoint: Setpoint) -> Bridge {
    // Decide the mode from what the last period saw. While field-oriented control drives, only its schedule does
    // so: once per cycle, and in a start also where its own pieces are due. This precedes reading the sample, so
    // that no sample is kept across it.
    let field_oriented = if state.foc_drives_for(&setpoint) {
        match schedule::next(&mut state.foc.loops.slot) {
            Work::NOTHING => true,
            Work::REFERENCE => {
                // A drive's first period uses this slot.
                state.shared.seen.phase = state.phase;
                outer_loop::reference(config, &mut state.foc, &state.shared, &setpoint);
                true
            }
            due => outer_loop_slice(config, state, &setpoint, due),
        }
    } else {
        !mode_stays(config, state, &setpoint) && decide_mode(config, state, &setpoint)
    };

    // Sense. Then the mode's own work: voltage, duties, and what is seen.
    if !field_oriented {
        return other_modes(config, state, &sample, &setpoint);
    }
    match checked_currents(config, state, &sample, Readings::Currents) {
        Some(currents) => {
            state.shared.shown = currents;
            period(config, &mut state.foc, &mut state.shared, &sample, currents)
        }
        None => state.enters_rest().unwrap_or(Bridge::Off),
    }
}

/// What a sample's current readings are.
#[derive(Clone, Copy, PartialEq)]
enum Readings {
    /// Currents, which may be a fault.
    Currents,
    /// The sensors' offsets, which may not be measured yet: the bridge is off.
    Offsets,
}

/// Returns a sample's currents; `None` if the sample is a fault, which ends the drive.
// Inlined into the period: a call would pass the three currents through memory.
#[inline(always)]
fn checked_currents(
    config: &Config,
    state: &mut State,
    sample: &Sample,
    readings: Readings,
) -> Option<[AdcCounts; 3]> {
    let currents = state.shared.currents(config, sample);
    let bus = config.bus.of(sample.bus).scaled();
    let protection = &mut state.shared.protection;
    let flowing = (readings == Readings::Currents).then_some(currents);
    if let Some(fault) = protection::check(&config.protection, protection, flowing, bus) {
        state.change(config, Why::Tripped(fault));
        return None;
    }
    Some(currents)
}

/// Runs a period of any mode except field-oriented control, including every mode of the six-step drive.
// Inlined into the period, which has already saved the registers.
#[inline(always)]
fn other_modes(config: &Config, state: &mut State, sample: &Sample, setpoint: &Setpoint) -> Bridge {
    let readings = if state.phase.is_off() {
        Readings::Offsets
    } else {
        Readings::Currents
    };
    let currents = checked_currents(config, state, sample, readings);
    if let Some(bridge) = state.enters_rest() {
        return bridge;
    }
    if state.phase.is_off() {
        return bridge_off(config, state, sample, setpoint);
    }
    let Some(currents) = currents else {
        return Bridge::Off;
    };
    if state.phase == Phase::Brake && config.six_step.is_none() {
        brake::watch(config, &mut state.foc, &mut state.shared, sample, currents);
        return Bridge::Brake;
    }
    energised(config, state, sample, setpoint, currents)
}

/// Returns true if the mode need not be decided in this period:
///
/// - A drive at rest is asked for nothing, which also clears the count of failed starts.
/// - A drive in Sense is still asked to turn.
/// - The six-step drive decides by itself, but for faults.
/// - In Idle this period compares a turning rotor with its prediction, the longest of four, or a drive that has just ended
///   is not forgotten yet; a request waits for the next.
#[inline(always)] // in each period
fn mode_stays(config: &Config, state: &mut State, setpoint: &Setpoint) -> bool {
    match (state.phase, setpoint) {
        (Phase::Idle | Phase::Brake, Setpoint::Stop | Setpoint::Zero) => {
            let nothing = !state.tone.shorted_before && state.shared.latch.faults.is_empty();
            if nothing {
                state.shared.failed_starts = 0;
                state.shared.latch.forget_flight();
            }
            nothing
        }
        (_, Setpoint::Fault(_)) => false,
        (Phase::Idle, _) => state.off.is_compare_due() || state.begins_rest(),
        (phase, _) if phase.drives() => config.six_step.is_some(),
        (Phase::Sense, Setpoint::Speed(_)) => {
            config.six_step.is_none() && setpoint.rotation(config.both_ways) != Rotation::Rest
        }
        _ => false,
    }
}

/// Decides the mode from the set-point. Returns whether field-oriented control drives.
#[inline(never)] // only some periods
fn decide_mode(config: &Config, state: &mut State, setpoint: &Setpoint) -> bool {
    // Skips this period's slice of the outer loop, which comes round again, except the damping of a start, where
    // the observer is told once where the aligned rotor is. No other mode has this schedule.
    if state.foc_drives() && schedule::next(&mut state.foc.loops.slot) == Work::DAMP {
        open_loop::damp(config, &mut state.foc, &state.shared, state.phase);
    }
    if let Setpoint::Fault(fault) = setpoint {
        state.change(config, Why::Tripped(*fault));
    }
    if state.shared.latch.faults.is_empty()
        && let Some(why) = mode_change(config, state, setpoint)
    {
        state.change(config, why);
    }
    state.set_foc_kind(config, setpoint);
    state.shared.seen.phase = state.phase;
    state.foc_drives()
}

/// Runs this period's slice of field-oriented control's outer loop, with its mode changes. Returns whether
/// field-oriented control still drives.
// Cold, to keep its needs out of the periods without it.
#[cold]
#[inline(never)]
fn outer_loop_slice(config: &Config, state: &mut State, setpoint: &Setpoint, due: Work) -> bool {
    let phase = state.phase;
    let State { foc, shared, .. } = state;
    let why = match due {
        Work::DAMP => {
            open_loop::damp(config, foc, shared, phase);
            None
        }
        Work::START_CURRENT => open_loop::current(config, foc, shared, phase, setpoint),
        Work::SPEED_PRESET => {
            open_loop::preset_speed_regulator(config, foc);
            None
        }
        Work::HAND_OVER => open_loop::hand_over(config, foc, shared, phase),
        _ => combined_slice(config, state, setpoint, due),
    };
    if let Some(why) = why {
        state.change(config, why);
    }
    state.shared.seen.phase = state.phase;
    state.foc_drives()
}

/// Runs the pieces that may share a period; returns the mode change they call for.
#[inline(always)] // in each period
fn combined_slice(
    config: &Config,
    state: &mut State,
    setpoint: &Setpoint,
    due: Work,
) -> Option<Why> {
    let State { foc, shared, .. } = state;
    if due.includes(Work::ROTOR)
        && let Some(why) = open_loop::rotor_mode_change(config, foc, shared, state.phase, setpoint)
    {
        return Some(why);
    }
    outer_loop::work(config, foc, shared, due);
    if due.includes(Work::SETPOINT) {
        mode_change(config, state, setpoint)
    } else {
        None
    }
}

/// Runs a period with the bridge off.
#[inline(never)] // only some periods
fn bridge_off(config: &Config, state: &mut State, sample: &Sample, setpoint: &Setpoint) -> Bridge {
    let shared = &mut state.shared;
    if state.phase == Phase::Idle {
        off::watch(config, &mut state.off, shared, sample);
        if !shared.latch.faults.is_empty() {
            shared.latch.clear(config, setpoint);
        }
    } else if let Some(why) = off::sense(config, &mut state.off, shared, sample) {
        state.change(config, why);
    }
    Bridge::Off
}

/// Runs a period of Charge, of a tone, or of the six-step drive.
#[inline(never)] // only some periods
fn energised(
    config: &Config,
    state: &mut State,
    sample: &Sample,
    setpoint: &Setpoint,
    currents: [AdcCounts; 3],
) -> Bridge {
    let phase = state.phase;
    let shared = &mut state.shared;
    let (bridge, why) = match (phase, &config.six_step) {
        (Phase::Charge, _) => {
            let rotor = &mut state.off.rotor;
            let charged = charge::period(config, &mut state.charge, rotor, &mut shared.seen);
            let why = charged.and_then(|n| prepare_drive(config, state, sample, setpoint, n));
            (Bridge::Charge(config.charge.duty), why)
        }
        (Phase::Brake, _) => {
            six_step::period::watch(config, (&mut state.six_step, shared), currents);
            return Bridge::Brake;
        }
        (Phase::Tone, _) => return tone_or_test(config, state, currents, setpoint),
        (Phase::Ramp | Phase::Run | Phase::Stopping, Some(six_step)) => {
            let position = six_step::given::position(config, &state.foc.observer, shared);
            let drive = (&mut state.six_step, shared);
            let input = (sample, setpoint);
            six_step::period::period(config, six_step, drive, (phase, position), input, currents)
        }
        // The bridge-off modes have their own period, and so has field-oriented control.
        _ => return Bridge::Off,
    };
    if let Some(why) = why {
        state.change(config, why);
        state.set_foc_kind(config, setpoint);
    }
    state.enters_rest().unwrap_or(bridge)
}

/// Prepares the next mode in period `n`, from 1, after Charge.
#[cold]
#[inline(never)] // only some periods
fn prepare_drive(
    config: &Config,
    state: &mut State,
    sample: &Sample,
    setpoint: &Setpoint,
    n: u32,
) -> Option<Why> {
    let (foc, shared) = (&mut state.foc, &mut state.shared);
    if matches!(setpoint, Setpoint::Tone(_) | Setpoint::Excite(_)) {
        // A tone needs to know only what the supply allows.
        outer_loop::prepare(config, foc, shared, n);
        return (n + 1 >= tone::PREPARATION_PERIODS).then_some(Why::ToneReady);
    }
    match &config.six_step {
        Some(six_step) => {
            let position = six_step::given::position(config, &foc.observer, shared);
            let drive = (&mut state.six_step, shared);
            Some(six_step::period::begin(
                config,
                six_step,
                drive,
                (position, setpoint),
            ))
        }
        None => {
            let rotor = state.off.rotor;
            begin::begin(config, foc, shared, rotor, sample, setpoint, n)
        }
    }
}

/// Runs a period of a tone or a self-test.
#[inline(never)] // only some periods
fn tone_or_test(
    config: &Config,
    state: &mut State,
    currents: [AdcCounts; 3],
    setpoint: &Setpoint,
) -> Bridge {
    let shared = &mut state.shared;
    match (setpoint, &config.tone) {
        (Setpoint::Pull(pull), _) => {
            self_test::period(config, (&mut state.self_test, shared), currents, *pull)
        }
        (Setpoint::Excite(_), _)
            if !excite::trusts(&mut state.excite, shared.protection.trip, currents) =>
        {
            state.change(config, Why::Tripped(Fault::CurrentSensor));
            Bridge::Off
        }
        (Setpoint::Excite(excitation), _) => {
            excite::period(config, (&mut state.excite, shared), currents, *excitation)
        }
        (Setpoint::Tone(pitch), Some(tone)) => {
            tone::period(config, tone, (&mut state.tone, shared), currents, *pitch)
        }
        _ => Bridge::Off,
    }
}
