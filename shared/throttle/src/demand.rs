//! What a frame or a pulse demands of the motor.

use super::dshot::Kind;
pub use super::endpoints::Demand;
use super::endpoints::EndPoints;
use super::event::Event;

/// How frames and pulses are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// Throttle has two directions (`INP_3D`).
    pub two_directions: bool,
    /// End points of the pulse range.
    pub ends: EndPoints,
}

impl Default for Reading {
    /// One direction, 1000 to 2000 µs.
    fn default() -> Self {
        Self {
            two_directions: false,
            ends: EndPoints {
                min_us: 1000,
                max_us: 2000,
            },
        }
    }
}

impl Reading {
    /// Returns the demand of an event; a bad one has none.
    pub fn demand(&self, event: &Event) -> Option<Demand> {
        Some(match *event {
            Event::Frame { frame, .. } => match frame.kind(self.two_directions) {
                Kind::Throttle(throttle) => Demand::Throttle(throttle),
                Kind::Stop | Kind::Command(_) => Demand::Zero,
            },
            Event::Pulse { kind, width_ns, .. } => {
                self.ends.demand(kind, width_ns, self.two_directions)
            }
            Event::Bad => return None,
        })
    }
}
