//! Outer-loop work, time-sliced over 32 periods. In Run 21 of the 32 have none.
//!
//! The reference is computed every 8 periods (3 kHz with a PWM of 24 kHz, for a bandwidth of tens of hertz), and the
//! dead-time signs two periods after it. The supply and the bounds of i_q follow every 16; the observer's gains,
//! the delay's compensation, the decoupling and the changes of mode every 32. Every eighth period also publishes a
//! snapshot, wherever in the cycle that falls, so that more than half of all interrupts stay short.
//!
//! A tone and Brake have cycles of their own, in `tone.rs` and `foc/brake.rs`.

use crate::control::PERIODS;

/// Periods until every piece has been done: four times the outer loops' period.
pub(super) const CYCLE: u32 = 4 * PERIODS;

/// Periods from one look at the supply to the next: one that takes nothing back rises by volts a
/// millisecond.
pub(super) const SUPPLY_PERIODS: u32 = 2 * PERIODS;

/// Periods from one look at the rotor's swing to the next, in an open-loop start. A swing takes hundreds.
pub(super) const DAMP_PERIODS: u32 = 2;

/// Pieces of outer-loop work, none or several: what is due in one period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Work(u16);

impl Work {
    /// None.
    pub(super) const NOTHING: Self = Self(0);
    /// The current's reference, by the speed regulator or as it is commanded.
    pub(super) const REFERENCE: Self = Self(1);
    /// Dead-time signs.
    pub(super) const DEAD_TIME_SIGN: Self = Self(1 << 1);
    /// The supply's voltage and current.
    pub(super) const SUPPLY: Self = Self(1 << 2);
    /// The update of the observer's gains.
    pub(super) const OBSERVER_GAINS: Self = Self(1 << 3);
    /// The trip.
    pub(super) const TRIP_LEVEL: Self = Self(1 << 4);
    /// The bounds of i_q that the supply's current leaves.
    pub(super) const SUPPLY_BOUNDS: Self = Self(1 << 5);
    /// The longest vector that the supply gives.
    pub(super) const LONGEST_VECTOR: Self = Self(1 << 6);
    /// The bounds of i_q that the speed leaves, and i_d.
    pub(super) const SPEED_BOUNDS: Self = Self(1 << 7);
    /// Delay compensation.
    pub(super) const DELAY_COMPENSATION: Self = Self(1 << 8);
    /// The decoupling of the regulator's axes.
    pub(super) const DECOUPLING: Self = Self(1 << 9);
    /// The mode that the set-point asks for: it may end the drive.
    pub(super) const SETPOINT: Self = Self(1 << 10);
    /// The mode that the rotor allows, which may end the drive: then nothing else is done.
    pub(super) const ROTOR: Self = Self(1 << 11);
    /// The open-loop start's current, and what it makes of the frame's speed.
    pub(super) const START_CURRENT: Self = Self(1 << 12);
    /// The rotor's swing in the open-loop start's frame is damped.
    pub(super) const DAMP: Self = Self(1 << 13);
    /// The speed regulator is made ready for the end of an open-loop start.
    pub(super) const STAND_BY: Self = Self(1 << 14);
    /// The end of an open-loop start that has come to its speed.
    pub(super) const HAND_OVER: Self = Self(1 << 15);

    /// Those of which each has its periods for itself.
    const ALONE: Self = Self::REFERENCE
        .with(Self::START_CURRENT)
        .with(Self::DAMP)
        .with(Self::STAND_BY)
        .with(Self::HAND_OVER);

    /// Returns true if any of these pieces is among them.
    pub(super) const fn includes(self, pieces: Self) -> bool {
        self.0 & pieces.0 != 0
    }

    const fn with(self, piece: Self) -> Self {
        Self(self.0 | piece.0)
    }
}

/// A piece of work, the first period of a cycle in which it is due, and the periods from there to the next.
type Row = (Work, u32, u32);

/// The work of each period of a cycle.
type Cycle = [Work; CYCLE as usize];

/// Lays the rows out over a cycle.
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

/// Field-oriented control's.
const RUN: &[Row] = &[
    (Work::REFERENCE, 0, PERIODS),
    (Work::DEAD_TIME_SIGN, 2, PERIODS),
    (Work::SUPPLY, 2, SUPPLY_PERIODS),
    (Work::SUPPLY_BOUNDS, 2, SUPPLY_PERIODS),
    (Work::TRIP_LEVEL, 4, SUPPLY_PERIODS),
    (Work::LONGEST_VECTOR, 4, SUPPLY_PERIODS),
    (Work::SPEED_BOUNDS, 4, SUPPLY_PERIODS),
    (Work::OBSERVER_GAINS, 6, CYCLE),
    (Work::DELAY_COMPENSATION, 10, CYCLE),
    (Work::SETPOINT, 10, CYCLE),
    (Work::DECOUPLING, 26, CYCLE),
    (Work::ROTOR, 26, CYCLE),
];

/// An open-loop start's. Its current takes little of the supply's voltage and is bounded by the supply alone: it
/// needs neither the longest vector nor the bounds by the speed.
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
    (Work::STAND_BY, 28, CYCLE),
    (Work::HAND_OVER, 30, CYCLE),
];

/// Both schedules, one behind the other.
const SLOTS: [Cycle; 2] = [cycle(RUN), cycle(START)];

/// Returns true if a piece is due every so many periods of a cycle, and in no other.
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

// The paces that are counted on where the work is done, or that its limits are made for.
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

/// Period of a cycle: of Run's below [`CYCLE`], of the open-loop start's from there.
pub(super) type Slot = u8;

/// Takes the slot on by a period, and says what is done in it.
pub(super) fn next(slot: &mut Slot) -> Work {
    *slot = (*slot & !(CYCLE as u8 - 1)) | ((*slot + 1) % CYCLE as u8);
    SLOTS.as_flattened()[usize::from(*slot) % (2 * CYCLE as usize)]
}

/// Goes on in the start's schedule, or in Run's.
pub(super) fn choose(slot: &mut Slot, open_loop: bool) {
    *slot = *slot % CYCLE as u8 + if open_loop { CYCLE as u8 } else { 0 };
}

/// Returns true if a slot is of the open-loop start's schedule.
pub(super) fn is_start(slot: Slot) -> bool {
    slot >= CYCLE as u8
}

/// The slot from which the first one of a cycle follows.
pub(super) const LAST: Slot = CYCLE as u8 - 1;
