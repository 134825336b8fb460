//! Input of both laws.

use crate::control::observer::SlowEstimate;
use crate::trace::traced;
use crate::units::{Current, Speed};

/// Input of one period of speed control, [`PERIODS`](crate::control::PERIODS) of the drive, reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// Ω*.
    pub command: Speed,
    /// ω̄̂.
    pub speed: Speed,
    /// The slower part of the observer's estimate.
    pub slow_estimate: SlowEstimate,
    /// Bounds of i_q*.
    pub bounds: Bounds,
    /// i_q* less i_q of the last period where its voltage was limited, else zero: the torque that
    /// the supply cannot give.
    pub missing: Current,
}

traced! {
    /// Bounds of i_q*; by default no current.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Bounds {
        /// Least i_q*, at most zero: what braking may return.
        pub min: Current,
        /// Greatest i_q*.
        pub max: Current,
    }
}

impl Bounds {
    /// The current, held within.
    #[inline(always)] // in the longest period
    pub fn hold(self, i_q: Current) -> Current {
        i_q.min(self.max).max(self.min)
    }
}
