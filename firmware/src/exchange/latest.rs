//! Passes the latest value from one writer to one reader without either waiting: three slots, one with the
//! writer, one with the reader, one in between.
//!
//! Each side, when done, swaps its slot for the one in between. The reader always gets the last complete value;
//! a late reader misses earlier ones, never gets a mixture.

use core::mem::MaybeUninit;

use super::sync::{AtomicU8, Ordering, UnsafeCell, read, write};

/// Flag in the index in between: written since the reader's last swap.
const NEW: u8 = 4;

/// The three slots. Empty they are all zeros, which take no flash; an `Option`'s `None` need not be.
pub(crate) struct Latest<T> {
    places: [UnsafeCell<MaybeUninit<T>>; 3],
    between: AtomicU8,
}

// SAFETY: a slot is accessed only by the holder of its index, and each index is in one of three hands: the
// writer's, the reader's, or `between`. There is one writer and one reader.
unsafe impl<T: Copy + Send> Sync for Latest<T> {}

/// The writer's hand.
pub(crate) struct Writer {
    place: u8,
}

/// The reader's hand.
pub(crate) struct Reader {
    place: u8,
    /// A value has been read.
    filled: bool,
}

impl<T: Copy> Latest<T> {
    /// Creates empty slots.
    #[cfg(not(test))]
    pub(crate) const fn new() -> Self {
        Self {
            places: [const { UnsafeCell::new(MaybeUninit::uninit()) }; 3],
            between: AtomicU8::new(0),
        }
    }

    /// Creates empty slots; loom's cannot be made at compile time.
    #[cfg(test)]
    pub(crate) fn new() -> Self {
        Self {
            places: core::array::from_fn(|_| UnsafeCell::new(MaybeUninit::uninit())),
            between: AtomicU8::new(0),
        }
    }

    /// Returns the hands.
    ///
    /// # Safety
    /// Call it once for these slots.
    pub(crate) unsafe fn hands() -> (Writer, Reader) {
        let reader = Reader {
            place: 2,
            filled: false,
        };
        (Writer { place: 1 }, reader)
    }

    /// Publishes a value.
    #[inline(always)] // in each period
    pub(crate) fn publish(&self, hand: &mut Writer, value: T) {
        // SAFETY: the slot is in the writer's hand. The mask tells the compiler no more than that, and saves
        // the bounds check.
        unsafe {
            write(
                &self.places[usize::from(hand.place & 3) % 3],
                MaybeUninit::new(value),
            );
        }
        // Release: whoever gets the slot sees its contents. Acquire: whoever left the other is done with it.
        hand.place = self.between.swap(hand.place | NEW, Ordering::AcqRel) & !NEW;
    }

    /// Returns the latest value, or `None` before the first.
    pub(crate) fn read(&self, hand: &mut Reader) -> Option<T> {
        // Without a new value the reader's hand already has the latest.
        if self.between.load(Ordering::Relaxed) & NEW != 0 {
            hand.place = self.between.swap(hand.place, Ordering::AcqRel) & !NEW;
            hand.filled = true;
        }
        // SAFETY: the slot is in the reader's hand, and the writer has filled it.
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
            // SAFETY: once for these slots.
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
        // None, 1, 2 or 3, and never decreasing: all ten.
        assert_eq!(seen.len(), 10, "{seen:?}");
    }
}
