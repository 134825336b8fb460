//! Ctrl-C and SIGTERM while an ESC does something that this program began.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// The signal that came, if any.
pub(crate) struct Interrupt(Arc<AtomicUsize>);

impl Interrupt {
    /// Takes both signals from now on. A second one ends the program at once, whatever the ESC does.
    ///
    /// # Errors
    /// The system's.
    pub(crate) fn watch() -> io::Result<Self> {
        let came = Arc::new(AtomicUsize::new(0));
        let again = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            // Called in this order, so that the first signal does not see itself.
            flag::register_conditional_default(signal, Arc::clone(&again))?;
            flag::register(signal, Arc::clone(&again))?;
            flag::register_usize(signal, Arc::clone(&came), signal as usize)?;
        }
        Ok(Self(came))
    }

    /// Returns the signal, once.
    pub(crate) fn take(&self) -> Option<u8> {
        u8::try_from(self.0.swap(0, Ordering::Relaxed))
            .ok()
            .filter(|signal| *signal != 0)
    }
}
