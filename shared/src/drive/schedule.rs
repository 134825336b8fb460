//! Outer-loop work, time-sliced over 32 periods. In Run 20 of the 32 have none.
//!
//! The reference is computed every 8 periods (3 kHz with a PWM of 24 kHz, for a bandwidth of tens of hertz), and the
//! dead-time signs two periods after it. The supply and the bounds of i_q follow every 16; the observer's gains,
//! the delay's compensation, the decoupling and the changes of mode every 32.
//!
//! A tone and Brake have cycles of their own, in `tone.rs` and `foc/short.rs`.

use crate::control::PERIODS;

/// Periods until every piece has been done: four times the outer loops' period.
pub(super) const CYCLE: u32 = 4 * PERIODS;

/// Periods from one look at the supply to the next: one that takes nothing back rises by volts a
/// millisecond.
pub(super) const SUPPLY_PERIODS: u32 = 2 * PERIODS;

/// Periods from one look at the rotor's swing to the next, in an open-loop start. A swing takes hundreds.
pub(super) const DAMP_PERIODS: u32 = 2;

/// A piece of outer-loop work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Work {
    /// None.
    Nothing,
    /// The current's reference, by the speed regulator or as it is commanded.
    Reference,
    /// The open-loop start's current, and what it makes of the frame's speed.
    StartCurrent,
    /// The rotor's swing in the open-loop start's frame is damped.
    Damp,
    /// Dead-time signs; in Run the supply's voltage and current too.
    DeadTimeSign,
    /// The supply's voltage and current, in a start.
    Supply,
    /// The trip, and the bounds of i_q that the supply's current leaves; in Run the longest vector that the
    /// supply gives too.
    Bounds,
    /// The bounds of i_q that the speed leaves, and i_d.
    SpeedBounds,
    /// As [`DeadTimeSign`], and the update of the observer's gains.
    ObserverGains,
    /// Delay compensation, dead-time signs, and the mode that the set-point asks for: it may end the drive.
    Setpoint,
    /// The mode that the rotor allows, which may end the drive; dead-time signs, and the decoupling of the
    /// regulator's axes.
    Rotor,
    /// The speed regulator is made ready for the end of an open-loop start.
    Standby,
    /// The end of an open-loop start that has come to its speed.
    HandOver,
}

use Work::{
    Bounds, Damp, DeadTimeSign, HandOver, Nothing, ObserverGains, Reference, Rotor, Setpoint,
    SpeedBounds, Standby, StartCurrent, Supply,
};

/// Field-oriented control's work in each period of a cycle. Two periods after each reference
/// come the dead-time signs. 20 of 32 periods are empty; every eighth also publishes a snapshot, so that about half
/// of all interrupts stay short.
#[rustfmt::skip]
const RUN: [Work; CYCLE as usize] = [
    /*  0 */ Reference, Nothing, ObserverGains, Nothing, Bounds,  Nothing, SpeedBounds, Nothing,
    /*  8 */ Reference, Nothing, Setpoint,      Nothing, Nothing, Nothing, Nothing,     Nothing,
    /* 16 */ Reference, Nothing, DeadTimeSign,  Nothing, Bounds,  Nothing, SpeedBounds, Nothing,
    /* 24 */ Reference, Nothing, Rotor,         Nothing, Nothing, Nothing, Nothing,     Nothing,
];

/// An open-loop start's work in each period of a cycle.
#[rustfmt::skip]
const START: [Work; CYCLE as usize] = [
    /*  0 */ StartCurrent, Damp, ObserverGains, Damp, Supply,  Damp, Bounds,   Damp,
    /*  8 */ StartCurrent, Damp, Setpoint,      Damp, Nothing, Damp, Nothing,  Damp,
    /* 16 */ StartCurrent, Damp, DeadTimeSign,  Damp, Supply,  Damp, Bounds,   Damp,
    /* 24 */ StartCurrent, Damp, Rotor,         Damp, Standby, Damp, HandOver, Damp,
];

/// Returns true if a piece is in every so many slots from its first on, and in no other.
const fn is_every(schedule: &[Work; CYCLE as usize], work: Work, periods: u32) -> bool {
    let mut first = 0;
    while schedule[first] as u8 != work as u8 {
        first += 1;
    }
    let mut period = 0;
    while period < schedule.len() {
        let due = period % periods as usize == first % periods as usize;
        if (schedule[period] as u8 == work as u8) != due {
            return false;
        }
        period += 1;
    }
    first < periods as usize
}

const _: () = {
    assert!(is_every(&RUN, Reference, PERIODS));
    assert!(is_every(&START, StartCurrent, PERIODS));
    assert!(is_every(&START, Damp, DAMP_PERIODS));
    assert!(is_every(&START, Standby, CYCLE));
    assert!(is_every(&START, HandOver, CYCLE));
    assert!(is_every(&START, Supply, SUPPLY_PERIODS));
    assert!(is_every(&RUN, SpeedBounds, SUPPLY_PERIODS));
    let mut n = 0;
    while n < 2 {
        let schedule = [&RUN, &START][n];
        assert!(is_every(schedule, Bounds, SUPPLY_PERIODS));
        assert!(is_every(schedule, DeadTimeSign, CYCLE));
        assert!(is_every(schedule, ObserverGains, CYCLE));
        assert!(is_every(schedule, Setpoint, CYCLE));
        assert!(is_every(schedule, Rotor, CYCLE));
        n += 1;
    }
};

/// Period of a cycle: of Run's below [`CYCLE`], of the open-loop start's from there.
pub(super) type Slot = u8;

/// Both schedules, one behind the other.
const SLOTS: [[Work; CYCLE as usize]; 2] = [RUN, START];

/// Takes the slot on by a period, and says what is done in it.
#[inline(always)]
pub(super) fn next(slot: &mut Slot) -> Work {
    *slot = (*slot & !(CYCLE as u8 - 1)) | ((*slot + 1) % CYCLE as u8);
    SLOTS.as_flattened()[usize::from(*slot) % (2 * CYCLE as usize)]
}

/// Goes on in the start's schedule, or in Run's.
pub(super) fn choose(slot: &mut Slot, open_loop: bool) {
    *slot = *slot % CYCLE as u8 + if open_loop { CYCLE as u8 } else { 0 };
}

/// Returns true if a slot is of the open-loop start's schedule.
#[inline(always)]
pub(super) fn is_start(slot: Slot) -> bool {
    slot >= CYCLE as u8
}

/// The slot from which the first one of a cycle follows.
pub(super) const LAST: Slot = CYCLE as u8 - 1;
