//! Memory owned by an interrupt.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};

/// Holds the state of one interrupt. Filled once, before that interrupt is enabled.
pub(crate) struct InterruptCell<T> {
    filled: AtomicBool,
    value: UnsafeCell<MaybeUninit<T>>,
}

// SAFETY: callers of `with` guarantee a single user of the value at a time; `T` may move between contexts.
unsafe impl<T: Send> Sync for InterruptCell<T> {}

impl<T> InterruptCell<T> {
    /// Creates an empty cell: every byte that matters is 0.
    pub(crate) const fn new() -> Self {
        Self {
            filled: AtomicBool::new(false),
            value: UnsafeCell::new(MaybeUninit::uninit()),
        }
    }

    /// Fills the cell. Returns false, without calling `make`, if it was filled before.
    ///
    /// # Safety
    /// Call it from one context only, which nothing that calls this or [`with`](Self::with) may preempt.
    #[inline(always)] // the value is made in place
    pub(crate) unsafe fn put(&self, make: impl FnOnce() -> T) -> bool {
        if self.filled.load(Ordering::Relaxed) {
            return false;
        }
        // SAFETY: nobody else uses the value, as the caller promises.
        unsafe { self.value.get().write(MaybeUninit::new(make())) };
        self.filled.store(true, Ordering::Release);
        true
    }

    /// Calls `work` with the value.
    ///
    /// # Safety
    /// Only for the cell's interrupt, which does not preempt itself, or before it is enabled; and only once the
    /// cell is filled.
    #[inline(always)] // in each period
    pub(crate) unsafe fn with(&self, work: impl FnOnce(&mut T)) {
        // SAFETY: filled, and nobody else uses the value, as the caller promises.
        work(unsafe { (*self.value.get()).assume_init_mut() });
    }
}
