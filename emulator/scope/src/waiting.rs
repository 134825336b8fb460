//! Connections that have not said yet what they want.

use std::net::{Shutdown, TcpStream};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The connections whose request has not come yet, from the oldest: they give way where room is short, so that none who
/// keeps a server waiting keeps others out.
#[derive(Default)]
pub(crate) struct Waiting(Mutex<Vec<(u64, TcpStream)>>);

impl Waiting {
    /// Adds a connection under a number of its own.
    pub(crate) fn add(&self, number: u64, stream: TcpStream) {
        self.lock().push((number, stream));
    }

    /// Takes one off whose request has come, or does not come any more.
    pub(crate) fn remove(&self, number: u64) {
        self.lock().retain(|(other, _)| *other != number);
    }

    /// Ends the oldest. Returns false if there is none.
    pub(crate) fn end_oldest(&self) -> bool {
        let mut waiting = self.lock();
        if waiting.is_empty() {
            return false;
        }
        let (_, stream) = waiting.remove(0);
        // One that has gone by itself is ended too.
        let _ = stream.shutdown(Shutdown::Both);
        true
    }

    fn lock(&self) -> MutexGuard<'_, Vec<(u64, TcpStream)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
