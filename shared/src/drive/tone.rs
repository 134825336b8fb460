//! Tones: the motor as a loudspeaker, without turning it.
//!
//! The phases form a sine voltage along the axis of phase a, which pulls a rotor back and forth at the pitch and,
//! over a cycle, nowhere. The voltage is imposed, not the current, so that what a moving rotor induces drives a
//! braking current. A tone plays only to a standing rotor.
//!
//! The voltage amplitude starts at zero and is adjusted every half cycle towards the wanted peak phase current: R
//! and L may be stated wrongly, and the dead time takes an unknown part of so small a voltage, more in one half
//! cycle than in the next. It rises by a quarter of the square of the missing share and falls by half of the excess
//! share, so it arrives soon, and the larger half cycle stays near the target. In case a sensor reads nothing, the
//! amplitude itself is bounded to what twice the current and the dead time need.
//!
//! The voltage for that current is not computed from the stated R and L, one of which may be a hundred times the
//! true one, but learned: it starts at the lesser of what each alone would need, and doubles where twice as much
//! has not produced the current. What both as stated would need is the maximum.

use siskin_units::math::{Held, SinCos, TopProduct, magnitude};
use siskin_units::{
    AdcCounts, Angle, Current, Speed, TurnedVoltage, Voltage, WideVoltage, traced, wide,
};

use super::config::Config;
use super::config::tone::{self, PITCH_MAX};
use super::io::Bridge;
use super::phase::Phase;
use super::schedule::CYCLE;
use super::seen::{Seen, bus_current, greatest, reading};
use super::shared::Shared;
use crate::control::modulator::{self, Supply};
use crate::control::transform::{AlphaBeta, Dq};

/// The smallest voltage assumed for a current, as a right shift of the dead time's: crossing the latter in steps of
/// a quarter of the former takes some 30 half cycles.
const DEAD_SHIFT: u32 = 3;

/// The period after Charge in which a tone begins; the ones before it read the supply.
pub(super) const PREPARATION_PERIODS: u32 = 3;

/// Slot of the cycle that updates the supply voltage.
const SUPPLY_SLOT: u8 = 0;

/// Slot that updates the longest vector.
const LONGEST_SLOT: u8 = 16;

traced! {
    /// The tone being played.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub(super) struct State {
        /// Present slot of the cycle.
        slot: u8,
        /// Pitch in turns per period; zero is a pause.
        pitch: Speed,
        /// Angle of the sine.
        angle: Angle,
        /// Amplitude of the sine.
        amplitude: Voltage,
        /// Largest phase current since the last half cycle began.
        peak: Current,
        /// Voltage that the peak current needs, without the dead time's, as learned so far.
        needed: Voltage,
        /// The low sides were on before and will be again: at once after a played tone, otherwise once the rotor is
        /// seen to stand.
        pub(super) shorted_before: bool,
    }
}

impl State {
    /// Ends the tone and records whether to return to the low sides; the next tone initialises the rest.
    pub(super) fn end(&mut self, shorted_before: bool) {
        self.pitch = Speed::ZERO;
        self.shorted_before = shorted_before;
    }
}

/// Runs a period of a tone.
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
        SUPPLY_SLOT => shared.supply.set_bus(shared.protection.bus),
        LONGEST_SLOT => shared
            .supply
            .update_limits(&config.modulator, Voltage::ZERO),
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
        // A pause brakes any movement left from a tone and keeps the drivers charged.
        shared.applied.rest();
        return Bridge::Brake;
    }
    let v = AlphaBeta {
        alpha: u.scaled(),
        beta: TurnedVoltage::ZERO,
    };
    let duties = modulator::uncompensated(&config.modulator, &shared.supply, v);
    // A tone's voltage may be as long as the supply allows.
    let wanted = Dq {
        d: wide(u),
        q: WideVoltage::ZERO,
    };
    if modulator::square_of(wanted) > shared.supply.readable_square {
        shared.applied.expect_unreadable();
    }
    shared.applied.command(duties);
    Bridge::Duty(duties)
}

/// Returns the voltage along the axis of phase a.
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
    // Two periods share the work at the end of a half cycle; a tone's first period has only the second part.
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

/// Returns the voltage that the dead time takes.
#[inline(always)] // one caller
fn dead(tone: &tone::Config, supply: &Supply) -> Voltage {
    tone.dead.top(supply.bus).scaled()
}

/// Returns the learned voltage for the current, within plausible limits.
fn needed(tone: &tone::Config, playing: &State, supply: &Supply) -> Voltage {
    let reactive = tone.reactive.held(playing.pitch);
    let stated = magnitude(tone.resistive, reactive);
    let least = tone
        .resistive
        .min(reactive)
        .max(dead(tone, supply) >> DEAD_SHIFT);
    playing.needed.max(least).min(stated)
}

/// Sets the amplitude of the next half cycle.
fn regulate(tone: &tone::Config, playing: &mut State, supply: &Supply) {
    let needed = playing.needed;
    let dead = dead(tone, supply);
    let missing = tone.share.held(tone.peak.minus(playing.peak));
    // 28 + 31 − 32 fraction bits: half the product, with 28.
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
