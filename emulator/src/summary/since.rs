//! What reached, settled and locked have in common: how long they have held.

/// Time since which something has held without interruption, s.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Since(pub(super) Option<f64>);

impl Since {
    pub(super) fn add(&mut self, t_s: f64, holds: bool) {
        self.0 = if holds { self.0.or(Some(t_s)) } else { None };
    }
}
