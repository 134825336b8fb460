//! The self-test's pulls on half-bridges, without turning the motor.
//!
//! The duty of one leg rises from zero by a fixed step per period, and everything ends as soon as a phase carries
//! the test current: a shorted low side shows as a few amperes through the windings instead of an over-current
//! trip. The exception is a short in the first leg pulled: its own high side works against it, in pulses that end
//! before a sample sees them. The first is no longer than one duty step, and the hardware trip ends it there: the
//! comparator on that leg's shunt, or the gate driver. The last current remains readable, at one period's pace or
//! slower.

use siskin_units::{AdcCounts, Duty, traced};

use super::config::Config;
use super::io::Bridge;
use super::pull::Pull;
use super::seen::{greatest, reading};
use super::shared::Shared;
use crate::control::transform::Dq;

/// Periods in which the duty rises to full.
const RISE_PERIODS: u16 = 256;

/// Periods after which a current through two legs is given up: at a quarter of the supply.
const THROUGH_PERIODS: u16 = RISE_PERIODS / 4;

traced! {
    /// The pull in progress.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub(super) struct State {
        pull: Pull,
        periods: u16,
        over: bool,
    }
}

/// Runs one period of a self-test. The snapshot's d and q currents are those into the phases after the pulled one.
#[cold]
#[inline(never)] // only some periods
pub(super) fn period(
    config: &Config,
    (state, shared): (&mut State, &mut Shared),
    currents: [AdcCounts; 3],
    pull: Pull,
) -> Bridge {
    shared.applied.rest();
    if state.pull != pull {
        *state = State {
            pull,
            ..State::default()
        };
    }
    if pull == Pull::Open || state.over {
        return Bridge::Off;
    }
    let (leg, through) = (pull.leg(), pull.is_through());
    let at = |behind: u8| usize::from((leg + behind) % 3);
    let [own, next, last] = [0, 1, 2].map(|behind| reading(currents[at(behind)]));
    shared.seen.i = Dq { d: next, q: last };
    state.periods = (state.periods + 1).min(RISE_PERIODS);
    let risen = through && state.periods == THROUGH_PERIODS;
    state.over = greatest([own, next, last]) >= config.test_current || risen;
    if state.over {
        return Bridge::Off;
    }
    // At full duty the high side stays on at the counter's top too.
    let duty = if state.periods == RISE_PERIODS {
        Duty::MAX
    } else {
        Duty::from_bits(u32::from(state.periods) << (Duty::FRAC_NBITS - 8))
    };
    let mut legs = [None; 3];
    legs[at(0)] = Some(duty);
    let mut duties = [Duty::ZERO; 3];
    duties[at(0)] = duty;
    shared.applied.expect_unreadable();
    shared.applied.command(duties);
    if through {
        legs[at(1)] = Some(Duty::ZERO);
    }
    Bridge::Legs(legs)
}
