//! What one thread at a time may use, in a process that may be forked.

use std::process;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::thread;
use std::time::{Duration, Instant};

/// Time between two tries in a process that is not the one that made it.
const RETRY: Duration = Duration::from_millis(1);

/// Time for which it is locked by no thread of a forked process before it counts as lost: a thread that locks it says
/// so at once.
const LOST: Duration = Duration::from_millis(200);

/// Why it cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unusable {
    /// A panic may have left it half updated.
    Failed,
    /// A thread of the parent process held it when the process was forked: nobody here will give it back.
    Forked,
}

/// A value behind a lock.
pub(crate) struct Held<T> {
    inner: Mutex<T>,
    /// The process that made it.
    made_in: u32,
    /// The process whose thread holds it; 0 while none does.
    holder: AtomicU32,
}

impl<T> Held<T> {
    pub(crate) fn new(value: T) -> Self {
        Self {
            inner: Mutex::new(value),
            made_in: process::id(),
            holder: AtomicU32::new(0),
        }
    }

    /// Runs `work` on the value, once no other thread uses it.
    pub(crate) fn with<R>(&self, work: impl FnOnce(&mut T) -> R) -> Result<R, Unusable> {
        let mut guard = self.lock()?;
        self.holder.store(process::id(), Ordering::Relaxed);
        let result = work(&mut guard);
        self.holder.store(0, Ordering::Relaxed);
        Ok(result)
    }

    fn lock(&self) -> Result<MutexGuard<'_, T>, Unusable> {
        if process::id() == self.made_in {
            return self.inner.lock().map_err(|_| Unusable::Failed);
        }
        let mut since = Instant::now();
        loop {
            match self.inner.try_lock() {
                Ok(guard) => return Ok(guard),
                Err(TryLockError::Poisoned(_)) => return Err(Unusable::Failed),
                Err(TryLockError::WouldBlock) => {}
            }
            if self.holder.load(Ordering::Relaxed) == process::id() {
                since = Instant::now();
            } else if since.elapsed() > LOST {
                return Err(Unusable::Forked);
            }
            thread::sleep(RETRY);
        }
    }
}
