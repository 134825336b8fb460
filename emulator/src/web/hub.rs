//! What the simulation and the viewers share.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::message::FromPage;
use super::ring::Ring;

/// Viewers at a time.
pub(super) const MAX_VIEWERS: usize = 8;

/// Messages to the simulation that may wait: it takes them each millisecond, and a viewer waits behind them.
pub(super) const ORDERS: usize = 256;

/// Messages that may wait for a viewer, who takes them a hundred times a second: some seconds of MAVLink. Whoever
/// lets them pile up does not read, and is dropped.
const WAITING: usize = 1024;

/// A viewer.
pub(super) type ViewerId = u64;

/// Something from a viewer, and when it came.
pub(super) struct Order {
    pub(super) viewer: ViewerId,
    pub(super) came: Instant,
    pub(super) what: What,
}

/// What it is.
pub(super) enum What {
    /// MAVLink bytes.
    Mavlink(Vec<u8>),
    /// Something else.
    Asked(FromPage),
    /// The viewer is gone.
    Ended,
}

/// Something for a viewer.
pub(super) enum Message {
    /// A MAVLink frame.
    Mavlink(Vec<u8>),
    /// JSON.
    Text(String),
}

struct Viewer {
    id: ViewerId,
    outbox: SyncSender<Message>,
    dropped: Arc<AtomicBool>,
}

/// A viewer's side of the hub.
pub(super) struct Seat {
    pub(super) id: ViewerId,
    pub(super) orders: SyncSender<Order>,
    pub(super) inbox: Receiver<Message>,
    /// Raised when it has not read in time.
    pub(super) dropped: Arc<AtomicBool>,
}

/// The hub.
pub(super) struct Hub {
    viewers: Mutex<Vec<Viewer>>,
    count: AtomicUsize,
    next: Mutex<ViewerId>,
    orders: SyncSender<Order>,
    rings: Vec<Mutex<Ring>>,
}

impl Hub {
    /// For so many ESCs; the other part is the simulation's.
    pub(super) fn new(escs: usize) -> (Self, Receiver<Order>) {
        let (orders, from_viewers) = sync_channel(ORDERS);
        let hub = Self {
            viewers: Mutex::default(),
            count: AtomicUsize::new(0),
            next: Mutex::default(),
            orders,
            rings: (0..escs).map(|_| Mutex::default()).collect(),
        };
        (hub, from_viewers)
    }

    /// How many view.
    pub(super) fn viewers(&self) -> usize {
        self.count.load(Ordering::Relaxed)
    }

    /// Whether somebody views.
    pub(super) fn is_viewed(&self) -> bool {
        self.viewers() > 0
    }

    /// The ring of an ESC, if there is such a one.
    pub(super) fn ring(&self, esc: usize) -> Option<MutexGuard<'_, Ring>> {
        Some(lock(self.rings.get(esc)?))
    }

    /// A seat for a viewer, if one is free. The first one finds no old traces.
    pub(super) fn join(&self) -> Option<Seat> {
        let mut viewers = lock(&self.viewers);
        if viewers.len() == MAX_VIEWERS {
            return None;
        }
        if viewers.is_empty() {
            self.rings.iter().for_each(|ring| lock(ring).clear());
        }
        let mut next = lock(&self.next);
        *next += 1;
        let (outbox, inbox) = sync_channel(WAITING);
        let seat = Seat {
            id: *next,
            orders: self.orders.clone(),
            inbox,
            dropped: Arc::default(),
        };
        viewers.push(Viewer {
            id: seat.id,
            outbox,
            dropped: Arc::clone(&seat.dropped),
        });
        self.count.store(viewers.len(), Ordering::Relaxed);
        Some(seat)
    }

    /// Takes a viewer off; the last one takes the traces along.
    pub(super) fn leave(&self, id: ViewerId) {
        let mut viewers = lock(&self.viewers);
        viewers.retain(|viewer| viewer.id != id);
        self.count.store(viewers.len(), Ordering::Relaxed);
        if viewers.is_empty() {
            self.rings.iter().for_each(|ring| lock(ring).clear());
        }
    }

    /// Puts a message into the outbox of one viewer, or of all. Never waits.
    pub(super) fn send(&self, to: Option<ViewerId>, message: impl Fn() -> Message) {
        for viewer in lock(&self.viewers).iter() {
            if to.is_none_or(|id| id == viewer.id)
                && let Err(TrySendError::Full(_)) = viewer.outbox.try_send(message())
            {
                viewer.dropped.store(true, Ordering::Relaxed);
            }
        }
    }
}

/// A lock's content. Nothing here is left half done where a thread has died.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
