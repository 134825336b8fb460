//! Runs work beside Python's other threads, until it is done or Ctrl-C is pressed.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;

use crate::Error;

/// Time between two checks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// Runs `work` on a thread of its own, and sets the flag that it is given once Ctrl-C is pressed.
///
/// # Errors
/// What Ctrl-C raises in Python.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&AtomicBool) -> T + Send,
) -> PyResult<T> {
    let stop = &AtomicBool::new(false);
    let (done, is_done) = mpsc::channel();
    py.detach(move || {
        thread::scope(|scope| {
            let worker = scope.spawn(move || {
                let result = work(stop);
                // The receiver outlives the send: it waits for it.
                let _ = done.send(());
                result
            });
            let mut raised = None;
            while raised.is_none() && is_done.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                raised = pressed().err();
            }
            stop.store(raised.is_some(), Ordering::Relaxed);
            let result = worker.join();
            match (raised, result) {
                (Some(raised), _) => Err(raised),
                (None, Ok(result)) => Ok(result),
                (None, Err(_)) => Err(Error::new_err("the emulator has panicked")),
            }
        })
    })
}

/// Returns what Ctrl-C raises, if it has been pressed. Python checks for it on its main thread only.
fn pressed() -> PyResult<()> {
    Python::attach(|py| {
        py.check_signals()?;
        Ok(())
    })
}
