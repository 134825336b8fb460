//! The latest value from one writer for one reader, neither ever waiting: three places, one with the
//! writer, one with the reader, one between them.
//!
//! Each swaps its place for the one between when it is done. The reader finds the last value whole; a
//! reader that comes late misses earlier values, and gets no mixture.

use core::mem::MaybeUninit;

use super::sync::{AtomicU8, Ordering, UnsafeCell, read, write};

/// In the number of the place between: it was written since the last swap of the reader.
const NEW: u8 = 4;

/// The three places. Empty they are all zeros, which take no room in the flash, as an `Option`'s `None` need not be.
pub(crate) struct Latest<T> {
    places: [UnsafeCell<MaybeUninit<T>>; 3],
    between: AtomicU8,
}

// SAFETY: each place is reached only by whoever has its number, and a number is in one of three
// hands: the writer's, the reader's, or `between`. There is one writer and one reader.
unsafe impl<T: Copy + Send> Sync for Latest<T> {}

/// The writer's hand.
pub(crate) struct Writer {
    place: u8,
}

/// The reader's hand.
pub(crate) struct Reader {
    place: u8,
    /// True once a value has come.
    filled: bool,
}

impl<T: Copy> Latest<T> {
    /// The places, empty.
    #[cfg(not(test))]
    pub(crate) const fn new() -> Self {
        Self {
            places: [const { UnsafeCell::new(MaybeUninit::uninit()) }; 3],
            between: AtomicU8::new(0),
        }
    }

    /// The places, empty: loom's are not made at compile time.
    #[cfg(test)]
    pub(crate) fn new() -> Self {
        Self {
            places: core::array::from_fn(|_| UnsafeCell::new(MaybeUninit::uninit())),
            between: AtomicU8::new(0),
        }
    }

    /// The hands.
    ///
    /// # Safety
    /// To be called once for these places.
    pub(crate) unsafe fn hands() -> (Writer, Reader) {
        let reader = Reader {
            place: 2,
            filled: false,
        };
        (Writer { place: 1 }, reader)
    }

    /// Writes the latest value.
    #[inline(always)] // in each period
    pub(crate) fn publish(&self, hand: &mut Writer, value: T) {
        // SAFETY: the place is in the writer's hand. The mask says no more than that to the
        // compiler, which then needs no check.
        unsafe {
            write(
                &self.places[usize::from(hand.place & 3) % 3],
                MaybeUninit::new(value),
            );
        }
        // Release: who gets the place sees what is in it. Acquire: who has left the other is done.
        hand.place = self.between.swap(hand.place | NEW, Ordering::AcqRel) & !NEW;
    }

    /// The latest, or `None` while there has been none.
    pub(crate) fn read(&self, hand: &mut Reader) -> Option<T> {
        // A value that is not new is in the reader's hand already.
        if self.between.load(Ordering::Relaxed) & NEW != 0 {
            hand.place = self.between.swap(hand.place, Ordering::AcqRel) & !NEW;
            hand.filled = true;
        }
        // SAFETY: the place is in the reader's hand, and the writer has filled it.
        hand.filled
            .then(|| unsafe { read(&self.places[usize::from(hand.place)]).assume_init() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use loom::sync::Arc;
    use loom::thread;
    use std::collections::BTreeSet;
    use std::sync::Mutex;

    #[test]
    fn a_reader_sees_whole_values_in_their_order() {
        static SEEN: Mutex<BTreeSet<[Option<u32>; 2]>> = Mutex::new(BTreeSet::new());
        loom::model(|| {
            let latest = Arc::new(Latest::new());
            // SAFETY: once for these places.
            let (mut writer, mut reader) = unsafe { Latest::<[u32; 2]>::hands() };
            let theirs = Arc::clone(&latest);
            let interrupt = thread::spawn(move || {
                for number in 1..=3 {
                    theirs.publish(&mut writer, [number, !number]);
                }
            });
            let seen = [(); 2].map(|()| {
                latest.read(&mut reader).map(|[number, complement]| {
                    assert_eq!(complement, !number, "two values are mixed");
                    number
                })
            });
            assert!(seen[0] <= seen[1], "an older value came after a newer one");
            interrupt.join().expect("it does not panic");
            let [number, _] = latest.read(&mut reader).expect("three were written");
            assert_eq!(number, 3, "the latest is the last");
            SEEN.lock().expect("not poisoned").insert(seen);
        });
        let seen = SEEN.lock().expect("not poisoned");
        // None, 1, 2 or 3, and then not less: all ten.
        assert_eq!(seen.len(), 10, "{seen:?}");
    }
}
