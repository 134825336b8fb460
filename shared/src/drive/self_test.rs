//! Half-bridges pulled by a self-test, without turning the motor.
//!
//! The duty of one leg rises from zero by the same step each period, and all ends as soon as a phase
//! carries the current of a test: a low side that is shorted shows as a current of a few amperes through
//! the windings, not as the trip of an over-current. Not so that of the first leg to be pulled: its own
//! high side works against it, in pulses that end before a sample sees them. The first is no longer than
//! a step of the duty, and there the hardware's trip ends it: the comparator on that leg's shunt, or the
//! gate driver. What flowed last stays to be read, at a period's pace or slower.

use super::config::Config;
use super::io::Bridge;
use super::pull::Pull;
use super::seen::{greatest, reading};
use super::shared::Shared;
use crate::control::transform::Dq;
use crate::trace::traced;
use crate::units::{AdcCounts, Duty};

/// Periods in which the duty comes to the whole.
const RISE_PERIODS: u16 = 256;

/// Periods after which a current through two legs is given up: a quarter of the supply.
const THROUGH_PERIODS: u16 = RISE_PERIODS / 4;

traced! {
    /// The pull under way.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub(super) struct State {
        pull: Pull,
        periods: u16,
        over: bool,
    }
}

/// A period of a self-test. The snapshot's currents d and q are those into the phases that follow the
/// pulled one.
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
    // Above the whole the high side stays on at the counter's top too.
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
