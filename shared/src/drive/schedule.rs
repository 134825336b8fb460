//! Outer-loop work, time-sliced over 32 periods; 19 of Run's 32 have none.
//!
//! Every 8 periods the reference is computed (3 kHz at 24 kHz PWM, for a bandwidth of tens of hertz), and two
//! periods later the dead-time signs. Every 16 come the supply and the bounds of i_q; every 32 the observer's
//! gains, delay compensation, decoupling and mode changes. The firmware publishes its snapshots in periods with little
//! work, so that those with much stay as short as they are.
//!
//! A tone and Brake have cycles of their own, in `tone.rs` and `foc/brake.rs`.

use crate::control::{PERIODS, weakening};

/// Periods until every piece has been done: four outer-loop periods.
pub(super) const CYCLE: u32 = 4 * PERIODS;

/// Periods between checks of the supply: one that sinks no current rises by volts per millisecond.
pub(super) const SUPPLY_PERIODS: u32 = 2 * PERIODS;

/// Periods between dampings of the rotor's swing in an open-loop start. A swing takes hundreds.
pub(super) const DAMP_PERIODS: u32 = 2;

/// The pieces of outer-loop work due in one period: none, one or several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Work(u16);

impl Work {
    /// None.
    pub(super) const NOTHING: Self = Self(0);
    /// The current reference, from the speed regulator or the command.
    pub(super) const REFERENCE: Self = Self(1);
    /// Dead-time signs.
    pub(super) const DEAD_TIME_SIGN: Self = Self(1 << 1);
    /// Supply voltage and current.
    pub(super) const SUPPLY: Self = Self(1 << 2);
    /// The observer's gains.
    pub(super) const OBSERVER_GAINS: Self = Self(1 << 3);
    /// The trip level.
    pub(super) const TRIP_LEVEL: Self = Self(1 << 4);
    /// The bounds of i_q from the supply current.
    pub(super) const SUPPLY_BOUNDS: Self = Self(1 << 5);
    /// The longest vector that the supply allows.
    pub(super) const LONGEST_VECTOR: Self = Self(1 << 6);
    /// The bounds of i_q from the speed, and i_d.
    pub(super) const SPEED_BOUNDS: Self = Self(1 << 7);
    /// Delay compensation.
    pub(super) const DELAY_COMPENSATION: Self = Self(1 << 8);
    /// The decoupling of the regulator's axes.
    pub(super) const DECOUPLING: Self = Self(1 << 9);
    /// The mode that the set-point asks for, which may end the drive.
    pub(super) const SETPOINT: Self = Self(1 << 10);
    /// The mode that the rotor allows, which may end the drive; nothing else is then done.
    pub(super) const ROTOR: Self = Self(1 << 11);
    /// The open-loop start's current, and the frame's speed derived from it.
    pub(super) const START_CURRENT: Self = Self(1 << 12);
    /// Damping of the rotor's swing in the open-loop start's frame.
    pub(super) const DAMP: Self = Self(1 << 13);
    /// Preparation of the speed regulator for the end of an open-loop start.
    pub(super) const SPEED_PRESET: Self = Self(1 << 14);
    /// The end of an open-loop start that has reached its speed.
    pub(super) const HAND_OVER: Self = Self(1 << 15);

    /// The pieces that share no period with others.
    const ALONE: Self = Self::REFERENCE
        .with(Self::START_CURRENT)
        .with(Self::DAMP)
        .with(Self::SPEED_PRESET)
        .with(Self::HAND_OVER);

    /// Returns true if it includes any of these pieces.
    pub(super) const fn includes(self, pieces: Self) -> bool {
        self.0 & pieces.0 != 0
    }

    const fn with(self, piece: Self) -> Self {
        Self(self.0 | piece.0)
    }
}

/// A piece of work, the first period of a cycle in which it is due, and its interval in periods.
type Row = (Work, u32, u32);

/// The work of each period of a cycle.
type Cycle = [Work; CYCLE as usize];

/// Expands the rows into a cycle.
const fn cycle(rows: &[Row]) -> Cycle {
    let mut cycle = [Work::NOTHING; CYCLE as usize];
    let mut row = 0;
    while row < rows.len() {
        let (piece, first, periods) = rows[row];
        assert!(first < periods && CYCLE.is_multiple_of(periods));
        let mut period = first;
        while period < CYCLE {
            let due = &mut cycle[period as usize];
            *due = due.with(piece);
            assert!(!Work::ALONE.includes(*due) || due.0.is_power_of_two());
            period += periods;
        }
        row += 1;
    }
    cycle
}

/// Field-oriented control.
const RUN: &[Row] = &[
    (Work::REFERENCE, 0, PERIODS),
    (Work::DEAD_TIME_SIGN, 2, PERIODS),
    (Work::SUPPLY, 2, SUPPLY_PERIODS),
    (Work::SUPPLY_BOUNDS, 2, SUPPLY_PERIODS),
    (Work::TRIP_LEVEL, 6, CYCLE),
    (Work::LONGEST_VECTOR, 4, SUPPLY_PERIODS),
    (Work::SPEED_BOUNDS, 5, SUPPLY_PERIODS),
    (Work::OBSERVER_GAINS, 6, CYCLE),
    (Work::DELAY_COMPENSATION, 10, CYCLE),
    (Work::SETPOINT, 10, CYCLE),
    (Work::DECOUPLING, 26, CYCLE),
    (Work::ROTOR, 26, CYCLE),
];

/// Open-loop start. Its current is bounded by the supply alone, so it needs no speed-dependent bounds, and takes little
/// of the supply's voltage: its longest vector, [`start_bus`](super::config::Config::start_bus), stays.
const START: &[Row] = &[
    (Work::DAMP, 1, DAMP_PERIODS),
    (Work::START_CURRENT, 0, PERIODS),
    (Work::DEAD_TIME_SIGN, 2, PERIODS),
    (Work::SUPPLY, 4, SUPPLY_PERIODS),
    (Work::TRIP_LEVEL, 6, SUPPLY_PERIODS),
    (Work::SUPPLY_BOUNDS, 6, SUPPLY_PERIODS),
    (Work::OBSERVER_GAINS, 2, CYCLE),
    (Work::DELAY_COMPENSATION, 10, CYCLE),
    (Work::SETPOINT, 10, CYCLE),
    (Work::DECOUPLING, 26, CYCLE),
    (Work::ROTOR, 26, CYCLE),
    (Work::SPEED_PRESET, 28, CYCLE),
    (Work::HAND_OVER, 30, CYCLE),
];

const _: () = assert!(SUPPLY_PERIODS == weakening::PERIODS);

/// Both schedules, one after the other.
const SLOTS: [Cycle; 2] = [cycle(RUN), cycle(START)];

/// Returns true if a piece is due in every `periods`-th period of a cycle and in no other.
const fn is_every(cycle: &Cycle, piece: Work, periods: u32) -> bool {
    let mut first = 0;
    while !cycle[first].includes(piece) {
        first += 1;
    }
    let mut period = 0;
    while period < cycle.len() {
        let due = period % periods as usize == first % periods as usize;
        if cycle[period].includes(piece) != due {
            return false;
        }
        period += 1;
    }
    first < periods as usize
}

// The intervals on which the work itself, or its limits, rely.
const _: () = {
    let [run, start] = &SLOTS;
    assert!(is_every(run, Work::REFERENCE, PERIODS));
    assert!(is_every(run, Work::SUPPLY, SUPPLY_PERIODS));
    assert!(is_every(run, Work::LONGEST_VECTOR, SUPPLY_PERIODS));
    assert!(is_every(run, Work::SPEED_BOUNDS, SUPPLY_PERIODS));
    assert!(is_every(start, Work::START_CURRENT, PERIODS));
    assert!(is_every(start, Work::DAMP, DAMP_PERIODS));
    assert!(is_every(start, Work::SUPPLY, SUPPLY_PERIODS));
    let mut n = 0;
    while n < SLOTS.len() {
        assert!(is_every(&SLOTS[n], Work::DEAD_TIME_SIGN, PERIODS));
        assert!(is_every(&SLOTS[n], Work::SUPPLY_BOUNDS, SUPPLY_PERIODS));
        assert!(is_every(&SLOTS[n], Work::OBSERVER_GAINS, CYCLE));
        assert!(is_every(&SLOTS[n], Work::SETPOINT, CYCLE));
        assert!(is_every(&SLOTS[n], Work::ROTOR, CYCLE));
        n += 1;
    }
};

/// Position in the schedule: below [`CYCLE`] in Run's cycle, from there in the open-loop start's.
pub(super) type Slot = u8;

/// Advances the slot by one period and returns the work due in it.
pub(super) fn next(slot: &mut Slot) -> Work {
    *slot = (*slot & !(CYCLE as u8 - 1)) | ((*slot + 1) % CYCLE as u8);
    SLOTS.as_flattened()[usize::from(*slot) % (2 * CYCLE as usize)]
}

/// Returns true if the slot has no work, or in a start only a little.
#[inline(always)] // in each period
pub(super) fn is_light(slot: Slot) -> bool {
    let work = SLOTS.as_flattened()[usize::from(slot) % (2 * CYCLE as usize)];
    work == Work::NOTHING || work == Work::SUPPLY
}

/// Switches to the start's schedule, or to Run's.
pub(super) fn choose(slot: &mut Slot, open_loop: bool) {
    *slot = *slot % CYCLE as u8 + if open_loop { CYCLE as u8 } else { 0 };
}

/// Returns true if a slot belongs to the open-loop start's schedule.
pub(super) fn is_start(slot: Slot) -> bool {
    slot >= CYCLE as u8
}

/// The slot just before the one in which a start with an aligned rotor tells the observer.
pub(super) const ALIGNED: Slot = 0;

/// The slot just before the first of a cycle.
pub(super) const LAST: Slot = CYCLE as u8 - 1;
