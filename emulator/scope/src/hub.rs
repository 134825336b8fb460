//! What the program and the viewers share.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use crate::show::Show;

/// Viewers at a time.
pub(crate) const MAX_VIEWERS: usize = 8;

/// Messages to the program that may wait: a simulation takes them each millisecond, and a viewer waits behind them.
pub const ORDERS: usize = 256;

/// Messages that may wait for a viewer, who takes them a hundred times a second: some seconds of MAVLink. Whoever
/// lets them pile up does not read, and is dropped.
const WAITING: usize = 1024;

/// A viewer.
pub type ViewerId = u64;

/// Something from a viewer.
pub struct Order<A> {
    /// From whom.
    pub viewer: ViewerId,
    /// When it came.
    pub came: Instant,
    /// What it is.
    pub what: What<A>,
}

/// What a viewer sends.
pub enum What<A> {
    /// MAVLink bytes.
    Mavlink(Vec<u8>),
    /// Something else.
    Asked(A),
    /// The viewer is gone.
    Ended,
}

/// Something for a viewer.
pub(crate) enum Message {
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
pub(crate) struct Seat<A> {
    pub(crate) id: ViewerId,
    pub(crate) orders: SyncSender<Order<A>>,
    pub(crate) inbox: Receiver<Message>,
    /// Raised when it has not read in time.
    pub(crate) dropped: Arc<AtomicBool>,
}

/// The hub.
pub(crate) struct Hub<S: Show> {
    viewers: Mutex<Vec<Viewer>>,
    count: AtomicUsize,
    next: Mutex<ViewerId>,
    orders: SyncSender<Order<S::Asked>>,
    show: Arc<S>,
}

impl<S: Show> Hub<S> {
    /// Of what is shown; the other part is the program's.
    pub(crate) fn new(show: Arc<S>) -> (Self, Receiver<Order<S::Asked>>) {
        let (orders, from_viewers) = sync_channel(ORDERS);
        let hub = Self {
            viewers: Mutex::default(),
            count: AtomicUsize::new(0),
            next: Mutex::default(),
            orders,
            show,
        };
        (hub, from_viewers)
    }

    /// How many view.
    pub(crate) fn viewers(&self) -> usize {
        self.count.load(Ordering::Relaxed)
    }

    /// What is shown.
    pub(crate) fn show(&self) -> &S {
        &self.show
    }

    /// A seat for a viewer, if one is free.
    pub(crate) fn join(&self) -> Option<Seat<S::Asked>> {
        let mut viewers = lock(&self.viewers);
        if viewers.len() == MAX_VIEWERS {
            return None;
        }
        if viewers.is_empty() {
            self.show.viewed(true);
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

    /// Takes a viewer off.
    pub(crate) fn leave(&self, id: ViewerId) {
        let mut viewers = lock(&self.viewers);
        viewers.retain(|viewer| viewer.id != id);
        self.count.store(viewers.len(), Ordering::Relaxed);
        if viewers.is_empty() {
            self.show.viewed(false);
        }
    }

    /// Puts a message into the outbox of one viewer, or of all. Never waits.
    pub(crate) fn send(&self, to: Option<ViewerId>, message: impl Fn() -> Message) {
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
