//! Ctrl-C and requests to end.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A flag that an interrupt or a request to end raises. Each is only that, however many come: whoever has
/// asked for the flag ends soon, and what it has to tell is not cut short by a second one.
///
/// # Errors
/// The system's signals cannot be caught.
pub fn flag() -> io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    Ok(stop)
}
