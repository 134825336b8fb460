//! The memory that an interrupt works on.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};

/// Holds the state of one interrupt. It is filled once, before that interrupt is enabled.
pub(crate) struct InterruptCell<T> {
    filled: AtomicBool,
    value: UnsafeCell<MaybeUninit<T>>,
}

// SAFETY: who calls `with` sees to it that one user at a time is at the value; `T` may change
// contexts.
unsafe impl<T: Send> Sync for InterruptCell<T> {}

impl<T> InterruptCell<T> {
    /// An empty cell: all bytes 0 but those that do not matter.
    pub(crate) const fn new() -> Self {
        Self {
            filled: AtomicBool::new(false),
            value: UnsafeCell::new(MaybeUninit::uninit()),
        }
    }

    /// Fills the cell; `false`, and nothing is made, when it was filled before.
    ///
    /// # Safety
    /// For one context, which nothing that calls this or [`with`](Self::with) interrupts.
    #[inline(always)] // the value is made in place
    pub(crate) unsafe fn put(&self, make: impl FnOnce() -> T) -> bool {
        if self.filled.load(Ordering::Relaxed) {
            return false;
        }
        // SAFETY: nobody else is at the value, as the caller promises.
        unsafe { self.value.get().write(MaybeUninit::new(make())) };
        self.filled.store(true, Ordering::Release);
        true
    }

    /// Works on the value.
    ///
    /// # Safety
    /// For the cell's interrupt, which does not interrupt itself, and before it is enabled; and only
    /// once the cell is filled.
    #[inline(always)] // in each period
    pub(crate) unsafe fn with(&self, work: impl FnOnce(&mut T)) {
        // SAFETY: it is filled, and nobody else is at the value, as the caller promises.
        work(unsafe { (*self.value.get()).assume_init_mut() });
    }
}
