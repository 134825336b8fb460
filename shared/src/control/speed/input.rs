//! Input to both speed laws.

use siskin_units::{Current, Speed, traced};

use crate::control::observer::SlowEstimate;

/// Input to one period of speed control, [`PERIODS`](crate::control::PERIODS) control periods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// Ω*.
    pub command: Speed,
    /// ω̄̂.
    pub speed: Speed,
    /// The slow part of the observer's estimate.
    pub slow_estimate: SlowEstimate,
    /// Bounds of i_q*.
    pub bounds: Bounds,
    /// i_q* minus i_q of the last period if its voltage was limited, else zero: the torque that the
    /// supply cannot deliver.
    pub i_q_shortfall: Current,
}

traced! {
    /// Bounds of i_q*; no current by default.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Bounds {
        /// Smallest i_q*, at most zero: what braking may return.
        pub min: Current,
        /// Largest i_q*.
        pub max: Current,
    }
}

impl Bounds {
    /// Returns the current, clamped to the bounds.
    #[inline(always)] // in the longest period
    pub fn hold(self, i_q: Current) -> Current {
        i_q.min(self.max).max(self.min)
    }
}
