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
//! The voltage for that current is not taken from R and L as stated, one of which may be a hundred times
//! the true one, but learnt: it begins at the lesser of what each alone would take, and is doubled
//! where twice as much has not brought the current. What both as stated would take is the most.

use super::config::Config;
use super::config::tone::{self, PITCH_MAX};
use super::io::Bridge;
use super::phase::Phase;
use super::schedule::CYCLE;
use super::seen::{Seen, bus_current, greatest, reading};
use super::shared::Shared;
use crate::control::dead_time;
use crate::control::modulator::{self, Supply};
use crate::control::transform::{AlphaBeta, Dq, PhaseOrder};
use crate::math::{Held, SinCos, TopProduct, magnitude};
use crate::trace::traced;
use crate::units::{AdcCounts, Angle, Current, Speed, TurnedVoltage, Voltage, WideVoltage, wide};

/// The least that a current is taken to need, of what the dead time takes: crossing that in steps of a
/// quarter of so much takes some 30 half cycles.
const DEAD_SHIFT: u32 = 3;

/// The period after Charge in which a tone begins; those before it look at the supply.
pub(super) const READY_PERIODS: u32 = 3;

/// Slot of a cycle in which the supply's voltage is taken.
const SUPPLY_SLOT: u8 = 0;

/// Slot in which the longest vector is taken.
const LONGEST_SLOT: u8 = 16;

traced! {
    /// The tone that is being played.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub(super) struct State {
        /// The present slot of the cycle, in one of which the supply is looked at.
        slot: u8,
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
        pub(super) shorted_before: bool,
    }
}

impl State {
    /// No tone, and whether there are low sides to go back to; all else is begun by the next tone.
    pub(super) fn end(&mut self, shorted_before: bool) {
        self.pitch = Speed::ZERO;
        self.shorted_before = shorted_before;
    }
}

/// A period of a tone.
#[cold]
pub(super) fn period(
    config: &Config,
    tone: &tone::Config,
    (state, shared): (&mut State, &mut Shared),
    currents: [AdcCounts; 3],
    pitch: Speed,
) -> Bridge {
    state.slot = (state.slot + 1) % CYCLE as u8;
    match state.slot {
        SUPPLY_SLOT => shared.supply.follow(shared.protection.bus),
        LONGEST_SLOT => shared.supply.reach(&config.modulator, Voltage::ZERO),
        _ => {}
    }
    let currents = currents.map(reading);
    let u = play(tone, state, pitch, greatest(currents), &shared.supply);
    let i = Dq {
        d: currents[0],
        q: Current::ZERO,
    };
    let along = Dq {
        d: u,
        q: Voltage::ZERO,
    };
    shared.seen = Seen {
        phase: Phase::Tone,
        angle: Angle::ZERO,
        speed: Speed::ZERO,
        i,
        u: along,
        bus_current: bus_current(along, i, &shared.supply),
    };
    if state.pitch == Speed::ZERO {
        // A pause brakes what a tone has left of a movement, and keeps the drivers charged.
        shared.applied.rest();
        return Bridge::Brake;
    }
    let v = AlphaBeta {
        alpha: u.scaled(),
        beta: TurnedVoltage::ZERO,
    };
    let v = (v, PhaseOrder::NORMAL);
    let none = (&dead_time::Config::NONE, AlphaBeta::default());
    let duties = modulator::duties(&config.modulator, &shared.supply, v, none);
    // A tone's voltage may be as long as the supply gives.
    let wanted = Dq {
        d: wide(u),
        q: WideVoltage::ZERO,
    };
    if modulator::square_of(wanted) > shared.supply.readable {
        shared.applied.expect_unreadable();
    }
    shared.applied.command(duties);
    Bridge::Duty(duties)
}

/// The voltage along the axis of phase a.
fn play(
    tone: &tone::Config,
    playing: &mut State,
    pitch: Speed,
    greatest: Current,
    supply: &Supply,
) -> Voltage {
    let pitch = pitch.max(Speed::ZERO).min(PITCH_MAX);
    if pitch != playing.pitch {
        *playing = State {
            slot: playing.slot,
            pitch,
            shorted_before: playing.shorted_before,
            ..State::default()
        };
    }
    playing.peak = playing.peak.max(greatest);
    // The work at the end of a half cycle is shared by two periods; a tone's first period has the second half alone.
    let step = pitch.over_period();
    let ends = |angle: Angle| angle.is_negative() != angle.wrapping_sub(step).is_negative();
    if ends(playing.angle) {
        playing.needed = needed(tone, playing, supply);
    }
    playing.angle = playing.angle.wrapping_add(step);
    if ends(playing.angle) {
        regulate(tone, playing, supply);
    }
    let sine = SinCos::of(playing.angle).sin;
    playing.amplitude.top(sine).scaled()
}

/// The voltage that the dead time takes.
#[inline(always)] // one caller
fn dead(tone: &tone::Config, supply: &Supply) -> Voltage {
    tone.dead.top(supply.bus).scaled()
}

/// What has been learnt of the voltage that the current needs, as far as it can be true.
fn needed(tone: &tone::Config, playing: &State, supply: &Supply) -> Voltage {
    let reactive = tone.reactive.held(playing.pitch);
    let stated = magnitude(tone.resistive, reactive);
    let least = tone
        .resistive
        .min(reactive)
        .max(dead(tone, supply) >> DEAD_SHIFT);
    playing.needed.max(least).min(stated)
}

/// The amplitude of the coming half cycle.
fn regulate(tone: &tone::Config, playing: &mut State, supply: &Supply) {
    let needed = playing.needed;
    let dead = dead(tone, supply);
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
