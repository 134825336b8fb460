//! Tones: the motor as a loudspeaker, without turning it.
//!
//! The phases make a sine voltage along the axis of phase a, which pulls a rotor to and fro as often
//! as the pitch says and, over a cycle, nowhere. The voltage is imposed, not the current: what a rotor
//! that moves induces drives a current that brakes it. It is played only to a rotor that stands.
//!
//! The voltage's amplitude begins at zero and is led, each half cycle, to where the greatest phase
//! current is to be: R and L may be stated wrongly, and the dead time eats an unknown part of so
//! small a voltage, more of one half cycle than of the next. It rises by a quarter of the square of
//! the share that is missing and falls by half of the share that is too much: so it is soon there,
//! and the greatest of the half cycles stays near what is wanted. For a sensor that shows nothing,
//! the amplitude itself is bounded: by what twice the current and the dead time need.
//!
//! What the current needs is not taken from R and L as stated, one of which may be a hundred times
//! the true one, but learnt: it begins at the lesser of what each alone would take, and is doubled
//! where twice as much has not brought the current. What both as stated would take is the most.

use fixed::types::I1F31;

use super::launch::{self, Wish};
use super::slow::{self, CYCLE};
use super::state::Seen;
use super::turn::{bus_current, reading};
use super::{Bridge, Phase, Setpoint, State, pull};
use crate::control::catch::Rotor;
use crate::control::dead_time;
use crate::control::modulator::{self, Supply};
use crate::control::transform::{AlphaBeta, Dq, Order};
use crate::math::{Gain, Held, SinCos, TopProduct, magnitude};
use crate::units::{AdcCounts, Angle, Current, Speed, TurnedVoltage, Voltage};

/// Highest pitch, turns a period: with eight samples a cycle the greatest of them is at most 8 %
/// below the current's peak.
pub const PITCH_MAX: Speed = Speed::lit("0.125");

/// The least that a current is taken to need, of what the dead time takes: crossing that in steps of a
/// quarter of so much takes some 30 half cycles.
const DEAD_SHIFT: u32 = 3;

/// The period behind Charge in which a tone begins; those before it look at the supply.
const READY_PERIODS: u32 = 3;

/// Config of the tones.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Peak that the greatest phase current is led to.
    pub peak: Current,
    /// Current to its share of that.
    pub share: Gain<Current, I1F31>,
    /// R times the peak.
    pub resistive: Voltage,
    /// Pitch to ωL times the peak.
    pub reactive: Gain<Speed, Voltage>,
    /// What the dead time takes of a vector along a phase, of the supply.
    pub dead: I1F31,
}

/// The tone that is being played.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Playing {
    /// Turns a period; zero is a pause.
    pitch: Speed,
    /// The sine's angle.
    angle: Angle,
    /// The sine's amplitude.
    amplitude: Voltage,
    /// Greatest phase current since the last half cycle began.
    peak: Current,
    /// Voltage that the peak current needs beside the dead time's, as far as has been learnt.
    needed: Voltage,
    /// The low sides were on before, and will be again: at once where a tone has been played, else
    /// when the rotor is seen to stand.
    pub(super) braked: bool,
}

impl Playing {
    /// No tone, and no low sides to go back to; all else is begun by the next one.
    pub(super) fn end(&mut self) {
        self.pitch = Speed::ZERO;
        self.braked = false;
    }

    /// Every word.
    pub(super) fn trace(&self, out: &mut impl FnMut(u32)) {
        let Self {
            pitch,
            angle,
            amplitude,
            peak,
            needed,
            braked,
        } = self;
        out(pitch.to_bits() as u32);
        out(angle.to_bits() as u32);
        out(amplitude.to_bits() as u32);
        out(peak.to_bits() as u32);
        out(needed.to_bits() as u32);
        out(u32::from(*braked));
    }
}

/// Changes the phase for a tone or a test that is asked for, or that has ended, and where nothing that
/// was to begin is asked for any more. False where the set-point and the phase have nothing to do with that.
#[cold]
pub(super) fn follow(config: &super::Config, state: &mut State, setpoint: Setpoint) -> bool {
    let pulls = matches!(setpoint, Setpoint::Pull(_));
    let plays = pulls || config.tone.is_some() && matches!(setpoint, Setpoint::Tone(_));
    let rests = launch::wish(config, setpoint) == Wish::Rest;
    let braked = state.tone.braked;
    let stands = state.rotor == Rotor::Standing;
    match state.phase {
        Phase::Tone | Phase::Sense if plays => {}
        // A test charges what it needs, and is to find a short circuit before all low sides are on.
        Phase::Charge if pulls && stands => state.phase = Phase::Tone,
        Phase::Charge if plays && stands => {}
        Phase::Idle if plays && stands => to(state, Phase::Sense, braked),
        Phase::Brake if plays && state.seen.speed == Speed::ZERO => to(state, Phase::Sense, true),
        Phase::Tone if !rests => state.rest(Phase::Sense),
        Phase::Tone if braked => state.rest(Phase::Brake),
        Phase::Idle if braked && rests && stands => state.rest(Phase::Brake),
        Phase::Tone => state.rest(Phase::Idle),
        // Not the low sides: the rotor may turn, and is looked at until it stands.
        Phase::Sense | Phase::Charge if rests => to(state, Phase::Idle, braked),
        _ => return false,
    }
    true
}

/// On the way to a tone, or back from one that has not come to be played.
fn to(state: &mut State, phase: Phase, braked: bool) {
    state.rest(phase);
    state.tone.braked = braked;
}

/// A period in which a tone or a test may be played: `None` where none is asked for.
#[cold]
pub(super) fn period(
    config: &super::Config,
    state: &mut State,
    currents: [AdcCounts; 3],
    setpoint: Setpoint,
) -> Option<Bridge> {
    if let Setpoint::Pull(pull) = setpoint {
        return Some(pull::period(config, state, currents, pull));
    }
    let (Some(tone), Setpoint::Tone(pitch)) = (&config.tone, setpoint) else {
        return None;
    };
    if state.phase == Phase::Charge {
        let n = state.charge_periods - config.charge.periods;
        if n < READY_PERIODS {
            slow::begin(config, state, n);
            return Some(Bridge::Charge(config.charge.duty));
        }
        state.phase = Phase::Tone;
    }
    state.turn = (state.turn + 1) % CYCLE as u8;
    match state.turn {
        0 => state.supply.follow(state.protection.bus),
        16 => state.supply.reach(&config.modulator, Voltage::ZERO),
        _ => {}
    }
    let [a, b, c] = currents.map(reading);
    let greatest = a
        .saturating_abs()
        .max(b.saturating_abs())
        .max(c.saturating_abs());
    let u = play(tone, &mut state.tone, pitch, greatest, &state.supply);
    let i = Dq {
        d: a,
        q: Current::ZERO,
    };
    let along = Dq {
        d: u,
        q: Voltage::ZERO,
    };
    state.seen = Seen {
        phase: Phase::Tone,
        angle: Angle::ZERO,
        speed: Speed::ZERO,
        i,
        u: along,
        bus_current: bus_current(along, i, &state.supply),
    };
    if state.tone.pitch == Speed::ZERO {
        // A pause brakes what a tone has left of a movement, and keeps the drivers charged.
        return Some(Bridge::Brake);
    }
    let v = AlphaBeta {
        alpha: u.scaled(),
        beta: TurnedVoltage::ZERO,
    };
    let v = (v, Order::NORMAL);
    let none = (&dead_time::Config::NONE, AlphaBeta::default());
    let duties = modulator::duties(&config.modulator, &state.supply, v, none);
    state.applied[0] = duties;
    Some(Bridge::Duty(duties))
}

/// The voltage along the axis of phase a.
fn play(
    tone: &Config,
    playing: &mut Playing,
    pitch: Speed,
    greatest: Current,
    supply: &Supply,
) -> Voltage {
    let pitch = pitch.max(Speed::ZERO).min(PITCH_MAX);
    if pitch != playing.pitch {
        *playing = Playing {
            pitch,
            braked: playing.braked,
            ..Playing::default()
        };
    }
    playing.peak = playing.peak.max(greatest);
    let before = playing.angle;
    playing.angle = before.wrapping_add(pitch.over_period());
    if playing.angle.is_negative() != before.is_negative() {
        regulate(tone, playing, supply);
    }
    let sine = SinCos::of(playing.angle).sin;
    playing.amplitude.top(sine).scaled()
}

/// The amplitude of the coming half cycle.
fn regulate(tone: &Config, playing: &mut Playing, supply: &Supply) {
    let reactive = tone.reactive.held(playing.pitch);
    let stated = magnitude(tone.resistive, reactive);
    let dead: Voltage = tone.dead.top(supply.bus).scaled();
    let least = tone.resistive.min(reactive).max(dead >> DEAD_SHIFT);
    let needed = playing.needed.max(least).min(stated);
    let missing = tone.share.held(tone.peak.minus(playing.peak));
    // 28 + 31 − 32 fraction bits are half of it with 28.
    let half = needed.top(missing);
    let step = Voltage::from_bits(if half.is_negative() {
        half.to_bits()
    } else {
        half.top(missing).to_bits()
    });
    let wanted = playing.amplitude.plus(step).max(Voltage::ZERO);
    let most = needed.plus(needed).plus(dead).min(supply.longest.length());
    playing.needed = if wanted > most {
        needed.plus(needed)
    } else {
        needed
    };
    playing.amplitude = wanted.min(most);
    playing.peak = Current::ZERO;
}
