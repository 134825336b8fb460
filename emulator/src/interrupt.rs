//! Ctrl-C and requests to end.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, LazyLock};
use std::thread;
use std::time::Duration;

/// Time for which output may block before an interrupt ends the program without it: an active reader takes all of it in
/// less.
const STUCK: Duration = Duration::from_secs(1);

/// 128 plus the number of SIGINT, as a shell reports it.
const STATUS: i32 = 130;

/// True while output is blocked.
static IS_STUCK: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Returns a flag raised by an interrupt or a request to end. Repeated ones do nothing more: whoever asked for the flag
/// ends soon, and a second one does not cut its output short. Blocked output does not end: see [`writing`].
///
/// # Errors
/// The system's signals cannot be caught.
pub fn flag() -> io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, STATUS, Arc::clone(&IS_STUCK))?;
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    Ok(stop)
}

/// Writes output. If it takes longer than a second, as into a pipe whose reader has stopped, an interrupt or a request
/// to end terminates the program at once, with status 130.
pub fn writing<T>(write: impl FnOnce() -> T) -> T {
    let (written, wait) = mpsc::channel::<()>();
    let result = thread::scope(|scope| {
        scope.spawn(move || {
            if wait.recv_timeout(STUCK) == Err(RecvTimeoutError::Timeout) {
                IS_STUCK.store(true, Ordering::Relaxed);
            }
        });
        let result = write();
        drop(written);
        result
    });
    IS_STUCK.store(false, Ordering::Relaxed);
    result
}
