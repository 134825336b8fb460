//! The memory that the control interrupt and the tasks share.
//!
//! - In: the set-point, one atomic word with a sequence number. The interrupt counts how long the
//!   number has not changed; a set-point that is too old is `Stop`.
//! - Out: the snapshot, under a sequence lock. The interrupt is the only writer and never waits; a
//!   reader that was interrupted reads again.
//! - [`InterruptCell`]: what only the interrupt works on, handed to it once.
//!
//! [`open`] gives each end out once, so the types see to the single writers.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering, compiler_fence};

use fixed::types::I1F31;
use siskin_control::drive::{Fault, Setpoint, Snapshot};
use siskin_control::units::{Current, Speed};

/// Kind of set-point, in the word's bits 31 to 29.
const KIND_SHIFT: u32 = 29;
const REST: u32 = 0;
const SPEED: u32 = 1;
const TORQUE: u32 = 2;
const TEST: u32 = 3;
const VOLTAGE: u32 = 4;
const TONE: u32 = 5;

/// The sequence number's place: bits 28 to 24.
const SEQUENCE_SHIFT: u32 = 24;
const SEQUENCE_MASK: u32 = 0x1f;

/// The value's place: bits 23 to 0 hold the upper 24 bits of a speed, a current, a pitch or a share. The speed's
/// step is then 0.0072 mechanical rpm with 12 pole pairs at 24 kHz.
const VALUE_SHIFT: u32 = 8;
const VALUE_MASK: u32 = 0x00ff_ffff;

static OPENED: AtomicBool = AtomicBool::new(false);
static SETPOINT: AtomicU32 = AtomicU32::new(REST << KIND_SHIFT);
static SNAPSHOT: SnapshotLock = SnapshotLock {
    sequence: AtomicU32::new(0),
    value: UnsafeCell::new(MaybeUninit::uninit()),
};

/// The ends of the exchange.
pub(crate) struct Ends {
    /// For the interrupt.
    pub(crate) interrupt: InterruptEnd,
    /// For the task that decides what the motor does.
    pub(crate) setpoint: SetpointWriter,
    /// For any task.
    pub(crate) snapshot: SnapshotReader,
}

/// Gives the ends out, the first time that it is called. A set-point whose sequence number has not
/// changed for more than `stale_periods` control periods is `Stop`.
pub(crate) fn open(stale_periods: u32) -> Option<Ends> {
    if OPENED.swap(true, Ordering::Relaxed) {
        return None;
    }
    Some(Ends {
        interrupt: InterruptEnd {
            sequence: 0,
            age_periods: 0,
            stale_periods,
        },
        setpoint: SetpointWriter { sequence: 0 },
        snapshot: SnapshotReader { _private: () },
    })
}

/// The interrupt's end.
pub(crate) struct InterruptEnd {
    sequence: u32,
    age_periods: u32,
    stale_periods: u32,
}

impl InterruptEnd {
    /// The set-point for this period; to be called once a period, which is how its age is counted.
    pub(crate) fn setpoint(&mut self) -> Setpoint {
        let word = SETPOINT.load(Ordering::Relaxed);
        let sequence = word >> SEQUENCE_SHIFT & SEQUENCE_MASK;
        if sequence == self.sequence {
            self.age_periods = self.age_periods.saturating_add(1);
        } else {
            self.sequence = sequence;
            self.age_periods = 0;
        }
        if self.age_periods > self.stale_periods {
            Setpoint::Stop
        } else {
            unpack(word)
        }
    }

    /// Puts the snapshot where the tasks find it.
    pub(crate) fn publish(&mut self, snapshot: Snapshot) {
        let sequence = SNAPSHOT.sequence.load(Ordering::Relaxed);
        SNAPSHOT
            .sequence
            .store(sequence.wrapping_add(1), Ordering::Relaxed);
        compiler_fence(Ordering::SeqCst);
        let place = SNAPSHOT.value.get();
        // SAFETY: there is one `InterruptEnd` and this takes it exclusively, so nobody else writes.
        // A reader may be in the middle of a copy: it is interrupted, sees the sequence number
        // changed, and throws the copy away without looking at it.
        unsafe { place.write_volatile(MaybeUninit::new(snapshot)) };
        compiler_fence(Ordering::SeqCst);
        SNAPSHOT
            .sequence
            .store(sequence.wrapping_add(2).max(2), Ordering::Relaxed);
    }
}

/// The end of the task that decides what the motor does.
pub(crate) struct SetpointWriter {
    sequence: u32,
}

impl SetpointWriter {
    /// Makes this the set-point, and renews it. 31 writes may happen within one control period
    /// before the interrupt could miss one.
    pub(crate) fn write(&mut self, setpoint: Setpoint) {
        self.sequence = self.sequence.wrapping_add(1) & SEQUENCE_MASK;
        SETPOINT.store(
            pack(setpoint) | self.sequence << SEQUENCE_SHIFT,
            Ordering::Relaxed,
        );
    }
}

/// Reads what the control publishes.
pub(crate) struct SnapshotReader {
    _private: (),
}

impl SnapshotReader {
    /// The latest snapshot, or `None` while there has been none.
    pub(crate) fn read(&self) -> Option<Snapshot> {
        loop {
            let before = SNAPSHOT.sequence.load(Ordering::Relaxed);
            if before == 0 {
                return None;
            }
            compiler_fence(Ordering::SeqCst);
            // SAFETY: the pointer is valid for reads. The one core runs the interrupt, which is the
            // writer, as a whole between two instructions of this copy, so the two do not run at
            // once. Bytes of two snapshots may be mixed: they stay uninterpreted in `MaybeUninit`.
            let copy = unsafe { SNAPSHOT.value.get().read_volatile() };
            compiler_fence(Ordering::SeqCst);
            let after = SNAPSHOT.sequence.load(Ordering::Relaxed);
            if before == after && after.is_multiple_of(2) {
                // SAFETY: the sequence number is not 0, so a snapshot has been written; it is even
                // and did not change during the copy, so the copy is one whole snapshot.
                return Some(unsafe { copy.assume_init() });
            }
        }
    }
}

struct SnapshotLock {
    /// Odd while the value is being written, 0 before the first.
    sequence: AtomicU32,
    value: UnsafeCell<MaybeUninit<Snapshot>>,
}

// SAFETY: the value is reached only in `InterruptEnd::publish` and `SnapshotReader::read`, which
// say why they do not disturb each other; a `Snapshot` is plain data.
unsafe impl Sync for SnapshotLock {}

fn pack(setpoint: Setpoint) -> u32 {
    let value = |bits: i32| (bits as u32) >> VALUE_SHIFT;
    match setpoint {
        Setpoint::Stop => REST << KIND_SHIFT,
        Setpoint::Zero => REST << KIND_SHIFT | 1,
        Setpoint::Fault(fault) => REST << KIND_SHIFT | (fault as u32 + 2),
        Setpoint::Speed(speed) => SPEED << KIND_SHIFT | value(speed.to_bits()),
        Setpoint::Torque(current) => TORQUE << KIND_SHIFT | value(current.to_bits()),
        Setpoint::Test(current) => TEST << KIND_SHIFT | value(current.to_bits()),
        Setpoint::Tone(pitch) => TONE << KIND_SHIFT | value(pitch.to_bits()),
        Setpoint::Voltage(share) => VOLTAGE << KIND_SHIFT | value(share.to_bits()),
    }
}

fn unpack(word: u32) -> Setpoint {
    // The shift throws kind and sequence number away and brings the sign back to bit 31.
    let bits = (word << VALUE_SHIFT) as i32;
    match word >> KIND_SHIFT {
        SPEED => Setpoint::Speed(Speed::from_bits(bits)),
        TORQUE => Setpoint::Torque(Current::from_bits(bits)),
        TEST => Setpoint::Test(Current::from_bits(bits)),
        TONE => Setpoint::Tone(Speed::from_bits(bits)),
        VOLTAGE => Setpoint::Voltage(I1F31::from_bits(bits)),
        _ => match word & VALUE_MASK {
            0 => Setpoint::Stop,
            1 => Setpoint::Zero,
            number => Fault::ALL
                .get(number as usize - 2)
                .map_or(Setpoint::Stop, |fault| Setpoint::Fault(*fault)),
        },
    }
}

const EMPTY: u8 = 0;
const READY: u8 = 1;
const BUSY: u8 = 2;

/// Holds what an interrupt works on. It is filled once; after that one user at a time gets at it,
/// and another one who comes meanwhile is turned away, never kept waiting.
pub(crate) struct InterruptCell<T> {
    state: AtomicU8,
    value: UnsafeCell<MaybeUninit<T>>,
}

// SAFETY: `state` lets one user at a time at the value; `T` may change contexts.
unsafe impl<T: Send> Sync for InterruptCell<T> {}

impl<T> InterruptCell<T> {
    /// An empty cell.
    pub(crate) const fn new() -> Self {
        Self {
            state: AtomicU8::new(EMPTY),
            value: UnsafeCell::new(MaybeUninit::uninit()),
        }
    }

    /// Fills the cell; `false`, and the value is dropped, when it was filled before.
    pub(crate) fn put(&self, value: T) -> bool {
        if !self.enter(EMPTY) {
            return false;
        }
        // SAFETY: the state was `EMPTY` and is `BUSY`: nobody else is at the value.
        unsafe { self.value.get().write(MaybeUninit::new(value)) };
        self.state.store(READY, Ordering::Release);
        true
    }

    /// Works on the value; does nothing when the cell is empty or in use.
    pub(crate) fn with(&self, work: impl FnOnce(&mut T)) {
        if self.enter(READY) {
            // SAFETY: the state was `READY`, so the value is there, and is `BUSY`: nobody else is
            // at it until the state is `READY` again.
            work(unsafe { (*self.value.get()).assume_init_mut() });
            self.state.store(READY, Ordering::Release);
        }
    }

    fn enter(&self, from: u8) -> bool {
        self.state
            .compare_exchange(from, BUSY, Ordering::Acquire, Ordering::Relaxed)
            .is_ok()
    }
}
