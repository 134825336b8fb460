//! A value that a task replaces as a whole and the interrupt reads in place: two slots, one of them in use. The
//! other belongs to the task until it offers the value that it has put there.

use core::mem::MaybeUninit;

use siskin_control::drive::put_default;

use super::sync::{AtomicU8, Ordering, UnsafeCell, with_mut};

/// No offer: the unused slot belongs to the task.
const QUIET: u8 = 0;
/// The unused slot waits for the interrupt.
const OFFERED: u8 = 1;

/// The two slots. Their contents need no drop.
pub(crate) struct Swap<T> {
    slots: [UnsafeCell<MaybeUninit<T>>; 2],
    state: AtomicU8,
}

// SAFETY: the user reads only the slot in use; the offerer writes only the other, and only in state `QUIET`;
// the user switches slots in state `OFFERED`. There is one of each.
unsafe impl<T: Send> Sync for Swap<T> {}

/// The task's end, which offers.
pub(crate) struct Offerer {
    /// The slot that is free, or becomes so next.
    free: usize,
}

/// The interrupt's end before there is a value to use.
pub(crate) struct Beginner(());

/// The interrupt's end, which uses the value.
pub(crate) struct User {
    used: usize,
}

impl<T: Default> Swap<T> {
    /// Puts the first value into use, as `make` fills it in place.
    pub(crate) fn begin(&self, _hand: Beginner, make: impl FnOnce(&mut T)) -> User {
        let user = User { used: 0 };
        // SAFETY: the slot in use is the user's.
        unsafe { fill(&self.slots[user.used], make) };
        user
    }
}

/// Puts a default into a slot and lets `make` change it in place: a copy would take much stack.
///
/// # Safety
/// Nobody else may access the slot meanwhile.
unsafe fn fill<T: Default, R>(
    slot: &UnsafeCell<MaybeUninit<T>>,
    make: impl FnOnce(&mut T) -> R,
) -> R {
    // SAFETY: guaranteed by the caller.
    unsafe { with_mut(slot, |place| make(put_default(place))) }
}

impl<T> Swap<T> {
    /// Creates two empty slots.
    #[cfg(not(test))]
    pub(crate) const fn new() -> Self {
        Self {
            slots: [const { UnsafeCell::new(MaybeUninit::uninit()) }; 2],
            state: AtomicU8::new(QUIET),
        }
    }

    /// Creates two empty slots; loom's cannot be made at compile time.
    #[cfg(test)]
    pub(crate) fn new() -> Self {
        Self {
            slots: core::array::from_fn(|_| UnsafeCell::new(MaybeUninit::uninit())),
            state: AtomicU8::new(QUIET),
        }
    }

    /// Returns the two ends.
    ///
    /// # Safety
    /// Call it once for these slots.
    pub(crate) unsafe fn hands() -> (Offerer, Beginner) {
        (Offerer { free: 1 }, Beginner(()))
    }

    /// Returns access to the free slot, or `None` while an earlier offer waits.
    #[inline(always)] // in each period
    pub(crate) fn free<'a>(&'a self, hand: &'a mut Offerer) -> Option<Free<'a, T>> {
        // Acquire: the user is done with the slot it left.
        let waits = self.state.load(Ordering::Acquire) == OFFERED;
        (!waits).then_some(Free { swap: self, hand })
    }

    /// Switches to an offered value, if any, after calling `change` with the old one and the new one.
    #[inline(always)] // in each period
    pub(crate) fn adopt(&self, hand: &mut User, change: impl FnOnce(&T, &T)) {
        if self.state.load(Ordering::Acquire) == OFFERED {
            let next = hand.used ^ 1;
            self.look(hand.used, |before| {
                self.look(next, |now| change(before, now));
            });
            hand.used = next;
            self.state.store(QUIET, Ordering::Release);
        }
    }

    /// Calls `work` with the value in use.
    #[inline(always)] // in each period
    pub(crate) fn with<R>(&self, hand: &User, work: impl FnOnce(&T) -> R) -> R {
        self.look(hand.used, work)
    }

    #[inline(always)] // in each period
    fn look<R>(&self, slot: usize, work: impl FnOnce(&T) -> R) -> R {
        let slot = &self.slots[slot & 1];
        #[cfg(not(test))]
        // SAFETY: the user reads the slot in use, which has held a value since `begin`, and the other while it
        // is offered, and therefore filled; the offerer writes to neither.
        let result = work(unsafe { (*slot.get()).assume_init_ref() });
        #[cfg(test)]
        // SAFETY: as above; loom checks it.
        let result = slot.with(|place| work(unsafe { (*place).assume_init_ref() }));
        result
    }
}

/// The offerer's slot.
pub(crate) struct Free<'a, T> {
    swap: &'a Swap<T>,
    hand: &'a mut Offerer,
}

impl<T: Default> Free<'_, T> {
    /// Offers what `make` puts into the slot, if it returns true. Returns true if it did.
    pub(crate) fn offer(self, make: impl FnOnce(&mut T) -> bool) -> bool {
        let slot = &self.swap.slots[self.hand.free & 1];
        // SAFETY: without an offer the unused slot is the offerer's.
        let made = unsafe { fill(slot, make) };
        if made {
            self.hand.free ^= 1;
            self.swap.state.store(OFFERED, Ordering::Release);
        }
        made
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use loom::sync::Arc;
    use loom::thread;
    use std::collections::BTreeSet;
    use std::sync::Mutex;

    /// Three periods use the values while a task offers 1 and then, if it may, 2. Loom takes another path when
    /// a thread yields between two of its steps, so both are tried.
    #[test]
    fn a_period_uses_one_whole_value_and_changes_over_in_order() {
        static SEEN: Mutex<BTreeSet<(bool, [u32; 3])>> = Mutex::new(BTreeSet::new());
        for pauses in [false, true] {
            loom::model(move || {
                let outcome = offer_twice(pauses);
                SEEN.lock().expect("not poisoned").insert(outcome);
            });
        }
        let seen = SEEN.lock().expect("not poisoned");
        // Without the second: 1 is adopted in one of three periods or after them.
        let refused = seen.iter().filter(|(second, _)| !second).count();
        assert_eq!(refused, 4, "{seen:?}");
        // With it: 1 in the first and 2 in the second, the third or later; or 1 in the second and 2 in the
        // third or later; or 1 in the third.
        let taken = seen.iter().filter(|(second, _)| *second).count();
        assert_eq!(taken, 6, "{seen:?}");
    }

    /// Offers the value; returns false if it could not be offered.
    fn offer<T: Default>(swap: &Swap<T>, hand: &mut Offerer, value: T) -> bool {
        if let Some(free) = swap.free(hand) {
            return free.offer(|slot| {
                *slot = value;
                true
            });
        }
        false
    }

    fn offer_twice(pauses: bool) -> (bool, [u32; 3]) {
        let swap = Arc::new(Swap::new());
        // SAFETY: once for these slots.
        let (mut offerer, beginner) = unsafe { Swap::<[u32; 2]>::hands() };
        let mut user = swap.begin(beginner, |slot| *slot = [0, !0]);
        let theirs = Arc::clone(&swap);
        let interrupt = thread::spawn(move || {
            [(); 3].map(|()| {
                theirs.adopt(&mut user, |before, now| assert_eq!(before[0] + 1, now[0]));
                let [number, complement] = theirs.with(&user, |value| *value);
                assert_eq!(complement, !number, "two values are mixed");
                if pauses {
                    thread::yield_now();
                }
                number
            })
        });
        assert!(offer(&swap, &mut offerer, [1, !1]));
        let second = offer(&swap, &mut offerer, [2, !2]) || {
            thread::yield_now();
            offer(&swap, &mut offerer, [2, !2])
        };
        let used = interrupt.join().expect("it does not panic");
        assert!(used.is_sorted(), "{used:?}");
        (second, used)
    }

    #[test]
    fn an_offer_waits_for_the_one_before() {
        loom::model(|| {
            let swap = Swap::new();
            // SAFETY: once for these slots.
            let (mut offerer, beginner) = unsafe { Swap::<u32>::hands() };
            let mut user = swap.begin(beginner, |slot| *slot = 0);
            assert!(offer(&swap, &mut offerer, 1));
            assert!(!offer(&swap, &mut offerer, 2));
            swap.adopt(&mut user, |_, _| {});
            assert!(offer(&swap, &mut offerer, 3));
            assert_eq!(swap.with(&user, |value| *value), 1);
            swap.adopt(&mut user, |before, now| assert_eq!((before, now), (&1, &3)));
            assert_eq!(swap.with(&user, |value| *value), 3);
        });
    }
}
