//! The throttle that a frame or pulse requests.

use siskin_throttle::demand::{Demand, Reading};
use siskin_throttle::dshot::Kind;
use siskin_throttle::signal::Signal;

use super::track::What;

/// A share of the throttle range, with the factory ends and one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Share {
    /// No throttle: a stop or a command.
    Zero,
    /// 0 to 1.
    Throttle(f64),
    /// Cannot be determined.
    None,
}

impl Share {
    /// Returns it as a number; `None` if it cannot be determined.
    pub(super) fn share(self) -> Option<f64> {
        match self {
            Self::Zero => Some(0.0),
            Self::Throttle(share) => Some((share * 1e4).round() / 1e4),
            Self::None => None,
        }
    }
}

/// Pulses that differ by less are shown as one, ns: a thousandth of the range.
pub(super) fn step_ns(signal: Signal) -> u32 {
    match signal {
        Signal::Pulse(kind) => {
            let end_points = kind.end_points_ns();
            (end_points.most - end_points.least) / 1000
        }
        Signal::Dshot { .. } => 0,
    }
}

/// Returns what a sighting requests.
pub(super) fn of(signal: Signal, what: &What) -> Share {
    match (what, signal) {
        (What::Frame { frame, .. }, _) => match frame.kind(false) {
            Kind::Stop | Kind::Command(_) => Share::Zero,
            Kind::Throttle(throttle) => Share::Throttle(throttle.to_num()),
        },
        (What::Pulse { width_ns }, Signal::Pulse(kind)) => {
            match Reading::default().ends.demand(kind, *width_ns, false) {
                Demand::Zero => Share::Zero,
                Demand::Throttle(throttle) => Share::Throttle(throttle.to_num()),
            }
        }
        _ => Share::None,
    }
}
