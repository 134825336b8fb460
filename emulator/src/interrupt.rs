//! Ctrl-C and requests to end.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A flag that an interrupt or a request to end raises.
///
/// # Errors
/// The system's signals cannot be caught.
pub fn flag() -> io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // A second one ends the program at once, with the status of one that a signal ended.
        let status = 128 + signal;
        signal_hook::flag::register_conditional_shutdown(signal, status, Arc::clone(&stop))?;
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    Ok(stop)
}
