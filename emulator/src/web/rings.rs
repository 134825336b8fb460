//! The traces of all ESCs, shared by the simulation and the viewers.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use siskin_scope::Show;

use super::message::FromPage;
use super::ring::{Chunk, Ring};
use super::view;

/// The rings.
pub(super) struct Rings {
    each: Vec<Mutex<Ring>>,
    viewed: AtomicBool,
}

impl Rings {
    /// Creates rings for this many ESCs.
    pub(super) fn new(escs: usize) -> Self {
        Self {
            each: (0..escs).map(|_| Mutex::default()).collect(),
            viewed: AtomicBool::new(false),
        }
    }

    /// Returns true if anyone is viewing.
    pub(super) fn is_viewed(&self) -> bool {
        self.viewed.load(Ordering::Relaxed)
    }

    /// Adds a full chunk of an ESC, and returns one to fill.
    pub(super) fn push(&self, esc: usize, chunk: Chunk) -> Option<Chunk> {
        Some(self.ring(esc)?.push(chunk))
    }

    fn ring(&self, esc: usize) -> Option<MutexGuard<'_, Ring>> {
        let ring = self.each.get(esc)?;
        // Nothing in it is left half done if a thread has died.
        Some(ring.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Show for Rings {
    type Asked = FromPage;
    type Held = Option<Vec<Arc<Chunk>>>;

    fn answer(&self, held: &mut Self::Held, asked: FromPage) -> Result<Vec<u8>, FromPage> {
        let FromPage::View(view) = asked else {
            return Err(asked);
        };
        let latest = || self.ring(view.esc).map(|ring| ring.chunks());
        let before = if view.hold { held.take() } else { None };
        let chunks = before.or_else(latest).unwrap_or_default();
        let answer = view::answer(&view, &chunks);
        *held = view.hold.then_some(chunks);
        Ok(answer)
    }

    /// The first viewer finds no old traces, and the last clears them.
    fn viewed(&self, is_viewed: bool) {
        for esc in 0..self.each.len() {
            if let Some(mut ring) = self.ring(esc) {
                ring.clear();
            }
        }
        self.viewed.store(is_viewed, Ordering::Relaxed);
    }
}
