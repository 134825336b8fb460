//! Atomics and cells of the exchange: core's, or in tests those of loom, which tries every order in which two
//! threads may see them.

#[cfg(not(test))]
pub(super) use core::{
    cell::UnsafeCell,
    sync::atomic::{AtomicU8, Ordering},
};
#[cfg(test)]
pub(super) use loom::{
    cell::UnsafeCell,
    sync::atomic::{AtomicU8, Ordering},
};

/// Writes a cell's content.
///
/// # Safety
/// Nobody else may access it.
#[inline(always)] // one access
pub(super) unsafe fn write<T>(cell: &UnsafeCell<T>, value: T) {
    #[cfg(not(test))]
    // SAFETY: as the caller promises.
    unsafe {
        *cell.get() = value;
    }
    #[cfg(test)]
    // SAFETY: as the caller promises; loom checks it.
    cell.with_mut(|place| unsafe { *place = value });
}

/// Calls `work` with a cell's content.
///
/// # Safety
/// Nobody else may access it.
#[inline(always)] // one access
pub(super) unsafe fn with_mut<T, R>(cell: &UnsafeCell<T>, work: impl FnOnce(&mut T) -> R) -> R {
    #[cfg(not(test))]
    // SAFETY: as the caller promises.
    let result = work(unsafe { &mut *cell.get() });
    #[cfg(test)]
    // SAFETY: as the caller promises; loom checks it.
    let result = cell.with_mut(|place| work(unsafe { &mut *place }));
    result
}

/// Copies a cell's content.
///
/// # Safety
/// Nobody may write to it meanwhile.
#[inline(always)] // one access
pub(super) unsafe fn read<T: Copy>(cell: &UnsafeCell<T>) -> T {
    #[cfg(not(test))]
    // SAFETY: as the caller promises.
    unsafe {
        *cell.get()
    }
    #[cfg(test)]
    // SAFETY: as the caller promises; loom checks it.
    cell.with(|place| unsafe { *place })
}
