//! Half-bridges pulled by a self-test, without turning the motor.
//!
//! The duty of one leg rises from zero by the same step each period, and all ends as soon as a phase
//! carries the current of a test: a low side that is shorted shows as a current of a few amperes through
//! the windings, not as the trip of an over-current. Not so that of the first leg to be pulled: its own
//! high side works against it, in pulses that end before a sample sees them. There only the supply's
//! limit and the gate driver's hold the current. What flowed last stays to be read, at a period's pace
//! or slower.

use super::turn::reading;
use super::{Bridge, Config, Phase, State};
use crate::control::transform::Dq;
use crate::units::{AdcCounts, Duty};

/// What is pulled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Pull {
    /// Nothing: all switches are off.
    #[default]
    Open = 0,
    /// Leg a to the supply: its high side on for more and more of the period and at last for all of it, the
    /// low side for the rest. The others are off.
    UpA = 1,
    /// Leg b, likewise.
    UpB = 2,
    /// Leg c, likewise.
    UpC = 3,
    /// Leg a up to a quarter of the period, with the low side of leg b on: a current flows into the motor by
    /// the one and back by the other.
    ThroughA = 4,
    /// Leg b, and c, likewise.
    ThroughB = 5,
    /// Leg c, and a, likewise.
    ThroughC = 6,
}

impl Pull {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 7] = [
        Self::Open,
        Self::UpA,
        Self::UpB,
        Self::UpC,
        Self::ThroughA,
        Self::ThroughB,
        Self::ThroughC,
    ];

    /// The one of a number; of any other, the first.
    pub const fn from_number(number: u8) -> Self {
        // Written out: a look-up would be a table in flash.
        match number {
            1 => Self::UpA,
            2 => Self::UpB,
            3 => Self::UpC,
            4 => Self::ThroughA,
            5 => Self::ThroughB,
            6 => Self::ThroughC,
            _ => Self::Open,
        }
    }

    /// Whether the low side of the next leg is on.
    pub const fn is_through(self) -> bool {
        self as u8 >= Self::ThroughA as u8
    }

    /// The leg that is pulled, 0, 1, 2 for a, b, c.
    pub const fn leg(self) -> u8 {
        match self {
            Self::Open | Self::UpA | Self::ThroughA => 0,
            Self::UpB | Self::ThroughB => 1,
            Self::UpC | Self::ThroughC => 2,
        }
    }
}

/// Periods in which the duty comes to the whole.
const RISE_PERIODS: u16 = 256;

/// Periods after which a current through two legs is given up: a quarter of the supply.
const THROUGH_PERIODS: u16 = RISE_PERIODS / 4;

/// The pull under way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pulling {
    pull: Pull,
    periods: u16,
    over: bool,
}

impl Pulling {
    /// Its words; none where nothing is pulled.
    pub(super) fn trace(&self, out: &mut impl FnMut(u32)) {
        let Self {
            pull,
            periods,
            over,
        } = *self;
        if pull != Pull::Open {
            out(pull as u32 | u32::from(over) << 8 | u32::from(periods) << 16);
        }
    }
}

/// A period of a self-test. The snapshot's currents d and q are those into the phases that follow the
/// pulled one.
#[cold]
#[inline(never)]
pub(super) fn period(
    config: &Config,
    state: &mut State,
    currents: [AdcCounts; 3],
    pull: Pull,
) -> Bridge {
    if state.pulling.pull != pull {
        state.pulling = Pulling {
            pull,
            ..Pulling::default()
        };
    }
    state.seen.phase = Phase::Tone;
    let pulling = &mut state.pulling;
    if pull == Pull::Open || pulling.over {
        return Bridge::Off;
    }
    let (leg, through) = (pull.leg(), pull.is_through());
    let at = |behind: u8| usize::from((leg + behind) % 3);
    let [own, next, last] = [0, 1, 2].map(|behind| reading(currents[at(behind)]));
    state.seen.i = Dq { d: next, q: last };
    let greatest = own
        .saturating_abs()
        .max(next.saturating_abs())
        .max(last.saturating_abs());
    pulling.periods = (pulling.periods + 1).min(RISE_PERIODS);
    let risen = through && pulling.periods == THROUGH_PERIODS;
    pulling.over = greatest >= config.test_current || risen;
    if pulling.over {
        return Bridge::Off;
    }
    // Above the whole the high side stays on at the counter's top too.
    let duty = if pulling.periods == RISE_PERIODS {
        Duty::MAX
    } else {
        Duty::from_bits(u32::from(pulling.periods) << (Duty::FRAC_NBITS - 8))
    };
    let mut legs = [None; 3];
    legs[at(0)] = Some(duty);
    state.applied[0][at(0)] = duty;
    if through {
        legs[at(1)] = Some(Duty::ZERO);
    }
    Bridge::Legs(legs)
}
